"""Everything this server uses of asyncua beside its public types (`asyncua.ua`), in this one module.

What stands here has no promise of staying as it is, so asyncua is bounded above to the minor version that is
tested. On an update this is the module to read against asyncua's changes; a test holds that no other module
of the product imports from inside asyncua.

=========================  ================================================================================
`AddressSpace` ...         the nodes, as asyncua keeps them: attributes and references of every `NodeData`
`StandardServer`           loads the standard address space and imports NodeSet2 files; never listens
`SecureConnection` ...     chunks, sequence numbers and keys of a secure channel
`SECURITY_POLICIES` ...    the algorithms of each security policy
`StrictBuffer` ...         the binary codec, behind checks that it lacks, and piece by piece
=========================  ================================================================================
"""

import functools
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from typing import Any, Final

from asyncua import Server as StandardServer
from asyncua import ua
from asyncua.common.connection import SecureConnection, TransportLimits
from asyncua.common.utils import Buffer, NotEnoughData
from asyncua.crypto import uacrypto
from asyncua.crypto.security_policies import (
    SecurityPolicyAes128Sha256RsaOaep,
    SecurityPolicyAes256Sha256RsaPss,
    SecurityPolicyBasic256Sha256,
    SecurityPolicyFactory,
    SecurityPolicyNone,
)
from asyncua.crypto.uacrypto import verify_pss_sha256, verify_sha256
from asyncua.server.address_space import AddressSpace, AttributeValue, NodeData
from asyncua.ua import ua_binary
from asyncua.ua.ua_binary import (
    nodeid_from_binary,
    struct_from_binary,
    struct_to_binary,
    uatcp_to_binary,
    variant_to_binary,
)
from asyncua.ua.uaprotocol_auto import DataChangeFilter as DecodedDataChangeFilter
from asyncua.ua.uatypes import datetime_to_win_epoch
from cryptography import exceptions

__all__ = [
    "INVALID_SIGNATURE",
    "MAX_READS_BEFORE_LOGIN",
    "SECURITY_POLICIES",
    "SIGNATURE_CHECKS",
    "AddressSpace",
    "AttributeValue",
    "Buffer",
    "DecodedDataChangeFilter",
    "NodeData",
    "NotEnoughData",
    "SecureConnection",
    "SecurityPolicyFactory",
    "SecurityPolicyNone",
    "StandardServer",
    "StrictBuffer",
    "TransportLimits",
    "address_space",
    "bound_null_arrays",
    "compute_attribute",
    "datetime_to_win_epoch",
    "encoded_pieces",
    "field_decoders",
    "new_standard_server",
    "nodeid_from_binary",
    "struct_from_binary",
    "struct_to_binary",
    "uatcp_to_binary",
    "variant_to_binary",
]

SECURITY_POLICIES: Final = {
    policy.URI.rpartition("#")[2]: policy
    for policy in (
        SecurityPolicyBasic256Sha256,
        SecurityPolicyAes128Sha256RsaOaep,
        SecurityPolicyAes256Sha256RsaPss,
    )
}
"""asyncua's class of each security policy, by the name its URI ends with."""

SIGNATURE_CHECKS: Final = {
    "http://www.w3.org/2001/04/xmldsig-more#rsa-sha256": verify_sha256,
    "http://opcfoundation.org/UA/security/rsa-pss-sha2-256": verify_pss_sha256,
}
"""Check of a signature, `(certificate, data, signature)`, by the URI of its algorithm (Part 7)."""

INVALID_SIGNATURE: Final = (uacrypto.InvalidSignature, exceptions.InvalidSignature)
"""What a signature that does not fit raises: asyncua's own where keys are shared, that of the library below
where they are public."""

MAX_NULLS: Final = 10_000
"""Longest array of nulls that is decoded: its elements take no bytes, so that its length bounds nothing.
As many as the operations of one request."""


MAX_READS: Final = 4_000
"""Reads from the buffer for one piece of a message, some 8 ms; the largest event filter takes 3 500."""

MAX_READS_BEFORE_LOGIN: Final = 500
"""The same for a request that needs no session, a millisecond; opening a session takes a hundred."""

Decoder = Callable[[Buffer], Any]


async def new_standard_server(application_uri: str) -> StandardServer:
    """Make asyncua's server for its standard address space alone: none of its services runs."""
    server = StandardServer()
    await server.init()
    server.iserver.method_service.stop()
    await server.set_application_uri(application_uri)
    return server


class StrictBuffer(Buffer):  # type: ignore[misc]
    """A buffer that cannot be read backwards, nor for long.

    In asyncua a string of length -2 moves the cursor two bytes back; an array of such strings never ends. And
    an array of a million empty strings takes a second: each piece of a message may be read `MAX_READS` times.
    """

    def __init__(self, data: bytes, start: int = 0, size: int = -1) -> None:
        super().__init__(data, start, size)
        self._reads = [0]
        self._most = MAX_READS

    def begin_piece(self, most: int | None = None) -> None:
        """Begin another piece of the message; from now on each is read `most` times."""
        self._reads[0] = 0
        if most is not None:
            self._most = most

    def read(self, size: int) -> bytes:
        """Read and take `size` bytes."""
        if size < 0:
            raise NotEnoughData(f"a length of {size}")
        self._reads[0] += 1
        if self._reads[0] > self._most:
            raise NotEnoughData(f"more than {self._most} values in one piece")
        data: bytes = super().read(size)
        return data

    def copy(self, size: int = -1) -> "StrictBuffer":
        """Return a view of the next `size` bytes, of all that is left by default; it is the same piece."""
        if size == -1 or size > len(self):
            size = len(self)
        view = StrictBuffer(self._data, self._cur_pos, size)
        view._reads, view._most = self._reads, self._most
        return view


class _BoundedNull:
    """Nulls, `MAX_NULLS` in one array at most: asyncua builds a list of any length from four bytes."""

    @staticmethod
    def pack(_data: object) -> bytes:
        return b""

    @staticmethod
    def unpack(_data: object) -> None:
        return None

    @staticmethod
    def pack_array(data: list[object] | None) -> bytes:
        packed: bytes = ua_binary.Primitives.Int32.pack(-1 if data is None else len(data))
        return packed

    @staticmethod
    def unpack_array(_data: object, length: int) -> tuple[None, ...]:
        if length > MAX_NULLS:
            raise NotEnoughData(f"an array of {length} nulls")
        return (None,) * max(length, 0)


def bound_null_arrays() -> None:
    """Put the bounded decoder of null arrays in place of asyncua's."""
    ua_binary.Primitives1.Null = ua_binary.Primitives.Null = _BoundedNull()


@functools.cache
def field_decoders(kind: type) -> tuple[tuple[str, Decoder, bool], ...]:
    """Find the decoders of the fields of a structure without optional ones, in order.

    Returns
    -------
    tuple of (name, decoder, is_array)
        Of an array of structures, NodeIds or status codes it is the decoder of one element.
    """
    hints = ua_binary.get_safe_type_hints(kind, {"ua": ua})
    decoders = list[tuple[str, Decoder, bool]]()
    for field in fields(kind):
        hint = hints[field.name]
        if _is_array_of_objects(hint):
            element = ua_binary._create_type_deserializer(ua_binary.type_from_list(hint), kind)  # noqa: SLF001
            decoders.append((field.name, element, True))
        elif ua_binary.type_allow_subclass(hint):
            decoders.append((field.name, ua_binary.extensionobject_from_binary, False))
        else:
            decoders.append((field.name, ua_binary._create_type_deserializer(hint, kind), False))  # noqa: SLF001
    return tuple(decoders)


def encoded_pieces(value: Any) -> Iterator[bytes]:
    """Encode a response field by field, and its arrays of anything but numbers element by element."""
    for name, encoder, is_array in _field_encoders(value.__class__):
        part = getattr(value, name)
        if name == "Parameters":
            yield from encoded_pieces(part)
        elif is_array:
            yield ua_binary.Primitives.Int32.pack(-1 if part is None else len(part))
            for element in part or ():
                if isinstance(element, ua.BrowseResult):
                    yield from encoded_pieces(element)
                else:
                    yield encoder(element)
        else:
            yield encoder(part)


@functools.cache
def _field_encoders(kind: type) -> tuple[tuple[str, Callable[[Any], bytes], bool], ...]:
    hints = ua_binary.get_safe_type_hints(kind, {"ua": ua})
    encoders = list[tuple[str, Callable[[Any], bytes], bool]]()
    for field in fields(kind):
        hint = hints[field.name]
        if _is_array_of_objects(hint):
            encoders.append(
                (field.name, ua_binary.create_type_serializer(ua_binary.type_from_list(hint)), True)
            )
        else:
            encoder = ua_binary.field_serializer(*ua_binary.resolve_uatype(hint), kind)
            encoders.append((field.name, encoder, False))
    return tuple(encoders)


def _is_array_of_objects(hint: Any) -> bool:
    """Whether each element takes work of its own; an array of numbers is packed as one."""
    if not ua_binary.type_is_list(hint):
        return False
    element = ua_binary.type_from_list(hint)
    return is_dataclass(element) and not ua_binary.type_allow_subclass(element)


def address_space(server: StandardServer) -> AddressSpace:
    """All nodes of a server."""
    return server.iserver.aspace


def compute_attribute(
    space: AddressSpace, node: ua.NodeId, attribute: ua.AttributeIds, compute: Callable[[], ua.DataValue]
) -> None:
    """Let an attribute be computed whenever it is read."""
    space[node].attributes[attribute].value_callback = lambda _node, _attribute: compute()
