"""What a client says in its Hello that it takes is what it gets."""

import contextlib
import struct

import pytest

from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.transport.secure_channel import ChannelSecurity, SecureChannel

SMALLEST = 8_192
"""Smallest buffer that a client may have, bytes (OPC UA Part 6, 7.1.2.3)."""


def chunks_of(data: bytes) -> list[int]:
    """Lengths of the chunks of a message."""
    lengths, place = list[int](), 0
    while place < len(data):
        lengths.append(struct.unpack_from("<I", data, place + 4)[0])
        place += lengths[-1]
    return lengths


@pytest.mark.parametrize("most", [1, 2, 3])
def test_no_response_has_more_chunks_than_the_client_takes(most: int) -> None:
    channel = SecureChannel(ChannelSecurity([], None, 2**20))  # type: ignore[arg-type]
    channel.acknowledge_hello(struct.pack("<IIIIIi", 0, SMALLEST, SMALLEST, 0, most, -1))
    sizes = range(SMALLEST - 400, (most + 1) * SMALLEST, 25)
    taken = 0
    for size in sizes:
        with contextlib.suppress(StatusCodeError):
            lengths = chunks_of(channel.encode_response(b"\0" * size, 1))
            assert len(lengths) <= most
            assert max(lengths) <= SMALLEST
            taken = size
    assert 0.95 * most * SMALLEST < taken < most * SMALLEST
    with pytest.raises(StatusCodeError, match="BadResponseTooLarge"):
        channel.encode_response(b"\0" * sizes[-1], 1)
