"""A stream of bytes cut into the frames of OPC UA TCP (Part 6, 7.1.2)."""

import struct
from collections.abc import Iterator
from typing import Final

from asyncua import ua

from impactcell.opcua.transport.secure_channel import MAX_CHUNK, SecureChannelError

HEADER: Final = struct.Struct("<3scI")
"""Type of the message, type of the chunk, length of all in bytes."""
MAX_HELLO_BYTES: Final = 8_192
"""Longest Hello: its URL has 4096 characters at most (Part 6, 7.1.2.3)."""
CHUNK_TYPES: Final = (b"F", b"C", b"A")
"""Final, one of several, and abandoned."""
SECURE_MESSAGE_TYPES: Final = (b"OPN", b"MSG", b"CLO")
"""Types that belong to a secure channel, whose number stands behind the header."""


class FrameStream:
    """What has come of a connection, until it is a whole frame."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._greeted = False

    def __len__(self) -> int:
        """Bytes that are no whole frame yet."""
        return len(self._buffer)

    def clear(self) -> None:
        """Forget what has come."""
        self._buffer.clear()

    def feed(self, data: bytes) -> Iterator[tuple[ua.Header, bytes]]:
        """Take bytes; give each frame that is whole, with its header and without.

        Raises
        ------
        SecureChannelError
            If what comes next is no frame; the frames before it were given.
        """
        self._buffer += data
        while len(self._buffer) >= HEADER.size:
            kind, chunk, size = HEADER.unpack_from(self._buffer)
            self._check_header(kind, chunk, size)
            if len(self._buffer) < size:
                break
            start = 12 if kind in SECURE_MESSAGE_TYPES else 8
            header = ua.Header(
                kind, chunk, int.from_bytes(self._buffer[8:12], "little") if start == 12 else 0
            )
            header.header_size, header.body_size, header.packet_size = start, size - start, size
            frame = bytes(self._buffer[start:size])
            del self._buffer[:size]
            yield header, frame

    def _check_header(self, kind: bytes, chunk: bytes, size: int) -> None:
        if not self._greeted:
            if kind != b"HEL":
                raise SecureChannelError(
                    ua.StatusCodes.BadTcpMessageTypeInvalid, f"{kind!r} in place of Hello"
                )
            limit = MAX_HELLO_BYTES
        elif kind in SECURE_MESSAGE_TYPES:
            limit = MAX_CHUNK
        else:
            raise SecureChannelError(ua.StatusCodes.BadTcpMessageTypeInvalid, f"a message of type {kind!r}")
        if chunk not in CHUNK_TYPES or (kind != b"MSG" and chunk != b"F"):
            raise SecureChannelError(ua.StatusCodes.BadTcpMessageTypeInvalid, f"a chunk of type {chunk!r}")
        if size > limit:
            raise SecureChannelError(ua.StatusCodes.BadTcpMessageTooLarge, f"a chunk of {size} bytes")
        if size < (16 if kind in SECURE_MESSAGE_TYPES else 8):
            raise SecureChannelError(ua.StatusCodes.BadTcpMessageTypeInvalid, f"a message of {size} bytes")
        self._greeted = True
