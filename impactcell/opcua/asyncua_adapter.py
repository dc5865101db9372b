"""Everything this server uses of asyncua beside its public types (`asyncua.ua`), in this one module.

What stands here has no promise of staying as it is, so asyncua is bounded above to the minor version that is
tested. On an update this is the module to read against asyncua's changes; a test holds that no other module
of the product imports from inside asyncua.

=========================  ================================================================================
`AddressSpace` ...         the nodes, as asyncua keeps them: attributes and references of every `NodeData`
`StandardServer`           loads the standard address space and imports NodeSet2 files; never listens
`SecureConnection` ...     chunks, sequence numbers and keys of a secure channel
`SECURITY_POLICIES` ...    the algorithms of each security policy
`StrictBuffer` ...         the binary codec, behind checks that it lacks
=========================  ================================================================================
"""

from collections.abc import Callable
from typing import Final

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
from asyncua.ua.ua_binary import nodeid_from_binary, struct_from_binary, struct_to_binary, uatcp_to_binary
from asyncua.ua.uaprotocol_auto import DataChangeFilter as DecodedDataChangeFilter
from asyncua.ua.uatypes import datetime_to_win_epoch
from cryptography import exceptions

__all__ = [
    "INVALID_SIGNATURE",
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
    "new_standard_server",
    "nodeid_from_binary",
    "struct_from_binary",
    "struct_to_binary",
    "uatcp_to_binary",
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


async def new_standard_server(application_uri: str) -> StandardServer:
    """Make asyncua's server for its standard address space alone: none of its services runs."""
    server = StandardServer()
    await server.init()
    server.iserver.method_service.stop()
    await server.set_application_uri(application_uri)
    return server


class StrictBuffer(Buffer):  # type: ignore[misc]
    """A buffer that cannot be read backwards.

    In asyncua a string of length -2 moves the cursor two bytes back; an array of such strings never ends.
    """

    def read(self, size: int) -> bytes:
        """Read and take `size` bytes."""
        if size < 0:
            raise NotEnoughData(f"a length of {size}")
        data: bytes = super().read(size)
        return data

    def copy(self, size: int = -1) -> "StrictBuffer":
        """Return a view of the next `size` bytes, of all that is left by default."""
        if size == -1 or size > len(self):
            size = len(self)
        return StrictBuffer(self._data, self._cur_pos, size)


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


def address_space(server: StandardServer) -> AddressSpace:
    """All nodes of a server."""
    return server.iserver.aspace


def compute_attribute(
    space: AddressSpace, node: ua.NodeId, attribute: ua.AttributeIds, compute: Callable[[], ua.DataValue]
) -> None:
    """Let an attribute be computed whenever it is read."""
    space[node].attributes[attribute].value_callback = lambda _node, _attribute: compute()
