"""What a client says in its Hello that it takes is what it gets."""

import struct
from itertools import count

import pytest
from asyncua import ua

from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.secure_channel import ChannelSecurity, SecureChannel

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
    longest = SMALLEST - 400

    def send_ever_longer_ones() -> None:
        nonlocal longest
        for size in count(longest, 25):
            lengths = chunks_of(channel.encode_response(b"\0" * size, 1))
            longest = size
            assert len(lengths) <= most
            assert max(lengths) <= SMALLEST

    with pytest.raises(StatusCodeError) as refused:
        send_ever_longer_ones()
    assert refused.value.code == ua.StatusCodes.BadResponseTooLarge
    assert longest > 0.95 * most * SMALLEST
