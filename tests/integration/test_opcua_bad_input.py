"""Bytes no client should send: answered at once with the standard's status code, and the server goes on."""

import asyncio
import contextlib
import logging
import random
import struct

import pytest
from asyncua import ua
from asyncua.ua.ua_binary import struct_to_binary

from impactcell.scada import ServerLimits
from tests.opcua_server import PATIENT, site
from tests.opcua_wire import alive, frame, hello, message, open_channel, raw
from tests.patience import PATIENCE_S

codes = ua.StatusCodes
BEFORE_HELLO = {
    "no OPC UA at all": (b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", codes.BadTcpMessageTypeInvalid),
    "a message in place of Hello": (open_channel(), codes.BadTcpMessageTypeInvalid),
    "an unknown message type": (frame(b"XYZ", b"12345678"), codes.BadTcpMessageTypeInvalid),
    "a chunk type that does not exist": (frame(b"HEL", b"\0" * 24, b"Z"), codes.BadTcpMessageTypeInvalid),
    "a size smaller than the header": (frame(b"HEL", b"", size=3), codes.BadTcpMessageTypeInvalid),
    "a size of 4 GiB": (frame(b"HEL", b"", size=2**32 - 1), codes.BadTcpMessageTooLarge),
    "an empty Hello": (frame(b"HEL", b""), codes.BadDecodingError),
    "a Hello that ends early": (frame(b"HEL", b"\0" * 10), codes.BadDecodingError),
    "a URL longer than the message": (
        frame(b"HEL", struct.pack("<IIIIIi", 0, 65536, 65536, 0, 0, 10_000)),
        codes.BadDecodingError,
    ),
    "a URL of negative length": (
        frame(b"HEL", struct.pack("<IIIIIi", 0, 65536, 65536, 0, 0, -2)),
        codes.BadDecodingError,
    ),
    "a URL of 5000 characters": (hello(b"x" * 5000), codes.BadTcpEndpointUrlInvalid),
    "buffers of 100 bytes": (hello(receive=100), codes.BadConnectionRejected),
}
AFTER_HELLO = {
    "a second Hello": (hello(), codes.BadTcpMessageTypeInvalid),
    "a request without a channel": (message(1, 1, b"\0" * 20), codes.BadSecureChannelClosed),
    "an unknown policy": (
        open_channel(uri=b"http://example.org/NoSuchPolicy"),
        codes.BadSecurityPolicyRejected,
    ),
    "a policy without a certificate": (
        open_channel(uri=b"http://opcfoundation.org/UA/SecurityPolicy#Basic256Sha256", mode=3),
        codes.BadSecurityChecksFailed,
    ),
    "encryption asked for without a policy": (open_channel(mode=3), codes.BadSecurityModeRejected),
    "renewal of no channel": (open_channel(request_type=1), codes.BadSecureChannelIdInvalid),
    "a chunk of 100 kB": (frame(b"MSG", b"", size=100_000), codes.BadTcpMessageTooLarge),
    "noise in an OPN": (frame(b"OPN", b"\xff" * 60), codes.BadSecurityPolicyRejected),
}


async def test_bad_beginnings() -> None:
    async with site(limits=ServerLimits(hello_s=3600.0, activation_s=3600.0)) as here:
        for name, (data, code) in BEFORE_HELLO.items():
            async with raw(here) as wire:
                await wire.send(data)
                assert await wire.error() == code, name
        for name, (data, code) in AFTER_HELLO.items():
            async with raw(here) as wire:
                await wire.send(hello())
                assert (await wire.receive())[0] == b"ACK"
                await wire.send(data)
                assert await wire.error() == code, name
        await alive(here)


@pytest.mark.slow
async def test_bad_requests_on_an_open_channel() -> None:
    async with site() as here:
        async with raw(here) as wire:
            channel, _ = await wire.channel()
            await wire.send(message(channel + 1, 13, b"\x01\x00\xac\x01" + b"\0" * 40))
            assert await wire.error() == codes.BadSecurityChecksFailed
        async with raw(here) as wire:
            channel, _ = await wire.channel()
            await wire.send(message(channel, 13, b"\x01\x00\xac\x01" + b"\0" * 3))
            assert await wire.error() == codes.BadDecodingError, "a request header that ends early"
        async with raw(here) as wire:
            channel, _ = await wire.channel()
            for kind, code in ((9999, codes.BadServiceUnsupported), (631, codes.BadSessionIdInvalid)):
                header = struct_to_binary(ua.RequestHeader())
                body = struct.pack("<BBH", 1, 0, kind) + header + b"\0" * 16
                await wire.send(message(channel, 13, body, sequence=kind - 9997 if kind == 9999 else 3))
                answer = (await wire.receive())[1]
                assert struct.unpack("<I", answer[16 + 4 + 8 + 4 : 16 + 4 + 8 + 8])[0] == code, kind
        async with raw(here) as wire:
            # Parts of one message without end: the limit of a message is the end.
            channel, _ = await wire.channel()
            with contextlib.suppress(ConnectionError):
                for sequence in range(2, 200):
                    body = struct.pack("<II", sequence, 2) + b"\0" * 60_000
                    await wire.send(frame(b"MSG", struct.pack("<II", channel, 13) + body, b"C"))
            assert await wire.error() == codes.BadTcpMessageTooLarge
        await alive(here)


async def test_a_fault_behind_a_fault(caplog: pytest.LogCaptureFixture) -> None:
    """The first is told, the connection ends, and the second, found while that is done, goes nowhere."""
    async with site() as here:
        for before in (hello(), hello() + message(1, 1, b"\0" * 20), hello() + hello()):
            async with raw(here) as wire:
                await wire.send(before + frame(b"XYZ", b"12345678"))
                assert await wire.error() == codes.BadTcpMessageTypeInvalid
        await alive(here)
    assert [record.message for record in caplog.records if record.levelno >= logging.ERROR] == []


@pytest.mark.parametrize("seed", range(2))
async def test_noise(seed: int) -> None:
    """Random bytes, and random changes of good messages, in every state of a connection."""
    rng = random.Random(seed)
    async with site() as here:
        for _ in range(100):
            async with raw(here) as wire:
                with contextlib.suppress(ConnectionError):
                    if rng.random() < 0.7:
                        await wire.send(hello())
                    if rng.random() < 0.7:
                        await wire.send(open_channel())
                    kind = rng.choice([428, 422, 461, 467, 631, 527, 673, 787, 826, 751])
                    good = (
                        struct.pack("<BBH", 1, 0, kind)
                        + struct_to_binary(ua.RequestHeader())
                        + rng.randbytes(60)
                    )
                    data = bytearray(message(6, 13, good))
                    for _ in range(rng.randrange(4)):
                        data[rng.randrange(8, len(data))] = rng.randrange(256)
                    await wire.send(bytes(data) if rng.random() < 0.8 else rng.randbytes(rng.randrange(200)))
                    wire.writer.write_eof()
                    await asyncio.wait_for(wire.reader.read(), PATIENCE_S)
        await alive(here)


@pytest.mark.slow
async def test_half_open_connections_are_closed_in_time() -> None:
    async with site(limits=ServerLimits(hello_s=0.5, activation_s=2.5)) as here:
        async with raw(here) as silent, raw(here) as stopped, raw(here) as idle:
            await idle.channel()
            await stopped.send(hello()[:20])
            assert await silent.error() == codes.BadTimeout, "says nothing"
            assert await stopped.error() == codes.BadTimeout, "stops in the middle of Hello"
            assert await idle.error() == codes.BadTimeout, "opens a channel and no session"
        await alive(here)


@pytest.mark.slow
async def test_too_many_connections() -> None:
    async with (
        site(limits=ServerLimits(connections=5, undisturbed_s=3600.0, **PATIENT)) as here,
        contextlib.AsyncExitStack() as stack,
    ):
        held = [await stack.enter_async_context(raw(here)) for _ in range(5)]
        for wire in held:
            await wire.send(hello())
            assert (await wire.receive())[0] == b"ACK"
        async with raw(here) as wire:
            assert await wire.error() == codes.BadTcpServerTooBusy
        held[0].writer.close()
        await held[0].writer.wait_closed()
        async with raw(here) as wire:
            await wire.send(hello())
            kind, _ = await wire.receive()
            assert kind in {b"ACK", b"ERR"}


@pytest.mark.slow
async def test_a_thousand_connections_at_once() -> None:
    """Those beyond the limit are told so before any cryptography; a client that is in goes on."""
    async with site(limits=ServerLimits(connections=50, undisturbed_s=3600.0, **PATIENT)) as here:
        here.publish()
        async with await here.client("observer") as inside:

            async def attempt() -> int:
                async with raw(here) as wire:
                    with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError):
                        await wire.send(hello())
                        kind, body = await wire.receive()
                        return struct.unpack("<I", body[:4])[0] if kind == b"ERR" else 0
                    return -1

            answers = await asyncio.gather(*(attempt() for _ in range(1000)))
            assert set(answers) <= {0, codes.BadTcpServerTooBusy}, set(answers)
            assert codes.BadTcpServerTooBusy in answers
            node = await here.node(inside, "Friction/StaticFriction")
            assert await node.read_value() == 0.2
