"""Read Device Identification, function 43/14: who made a device, and what it calls itself. Pure.

Reply (Modbus Application Protocol V1.1b3, section 6.21)::

    [ 43 ][ 14 ][ code ][ conformity ][ more follows ][ next ][ objects n ]  n x [ id ][ length ][ text ]
"""

from collections.abc import Mapping
from typing import Final

from pymodbus.pdu.mei_message import ReadDeviceInformationRequest

from impactcell.errors import ProtocolError
from impactcell.fieldbus.codec import MAX_PDU, FunctionCode, Request

OBJECTS: Final[Mapping[int, str]] = {
    0: "vendor", 1: "product code", 2: "revision", 3: "vendor URL", 4: "product", 5: "model",
    6: "application",
}  # fmt: skip
"""Objects of the basic and regular categories, by their numbers (section 6.21, table)."""
_MEI: Final = 14
"""Type of the encapsulated interface (same)."""
REGULAR: Final = 2
"""Code that asks for the basic and regular categories; a device that has less answers with less (same)."""
_PREFIX: Final = bytes([FunctionCode.ENCAPSULATED, _MEI, REGULAR])
_HEAD: Final = 7
"""Bytes before the first object."""


def identification_request(first: int = 0) -> Request:
    """Request for the objects from number `first` on."""
    encoded = ReadDeviceInformationRequest(read_code=REGULAR, object_id=first).encode()
    pdu = bytes([FunctionCode.ENCAPSULATED]) + encoded
    return Request(pdu, 0, _PREFIX, "the device identification", measure=_length)


def _length(pdu: bytes) -> int | None:
    """Return how long the reply is that begins with `pdu`; None while that cannot be said."""
    if not _PREFIX.startswith(pdu[:3]):
        raise ProtocolError("the device identification: the answer is for another request")
    if len(pdu) < _HEAD:
        return None
    end = _HEAD
    for _ in range(pdu[6]):
        if end + 2 > MAX_PDU:
            raise ProtocolError("the device identification: longer than a reply can be")
        if len(pdu) < end + 2:
            return None
        end += 2 + pdu[end + 1]
    if end > MAX_PDU:
        raise ProtocolError("the device identification: longer than a reply can be")
    return end


def identification_objects(data: bytes) -> tuple[dict[int, str], int | None]:
    """Read the data of a good reply, from the conformity on.

    Returns
    -------
    dict
        Texts by the numbers of their objects.
    int or None
        Where to ask on; None where nothing follows.
    """
    _, more, following, count = data[:4]
    objects, at = {}, 4
    for _ in range(count):
        number, length = data[at], data[at + 1]
        objects[number] = data[at + 2 : at + 2 + length].decode("utf-8", errors="replace").strip("\0 ")
        at += 2 + length
    return objects, following if more == 0xFF else None
