"""Replies that are checked and used together. Truth: each reply by itself, as the specification has it."""

import asyncio
import itertools
import socket
import struct
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.errors import LinkError, ModbusExceptionError, ProtocolError
from impactcell.fieldbus import register_client
from impactcell.fieldbus.codec import FunctionCode, read_request
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.request_batching import Exchange, PartialBlock, RequestBatch
from impactcell.fieldbus.transports import transport_for
from impactcell.fieldbus.transports.batch_in_flight import BatchInFlight
from impactcell.fieldbus.transports.transaction_ids import ID_COUNT, TransactionIds

HEAD = struct.Struct(">HHHBBB")
"""Transaction, protocol, length, unit, function and byte count of a reply to a read."""


def exchange() -> Exchange:
    async def make() -> Exchange:
        return Exchange()

    return asyncio.run(make())


EXCHANGE = exchange()


def good_reply(transaction: int, values: list[int], unit: int = 1) -> bytes:
    size = 2 * len(values)
    return HEAD.pack(transaction, 0, 3 + size, unit, 3, size) + struct.pack(f">{len(values)}H", *values)


@given(
    st.lists(st.integers(0, ID_COUNT - 1), min_size=1, max_size=20, unique=True),
    st.integers(1, 125),
    st.lists(st.tuples(st.integers(0, 6000), st.integers(1, 255)), max_size=2),
    st.integers(0, 6000),
    st.integers(0, 5),
)
def test_replies_are_good_together_if_each_is_by_itself(
    transactions: list[int], count: int, flips: list[tuple[int, int]], length: int, at: int
) -> None:
    requests = tuple(
        read_request(FunctionCode.READ_HOLDING, i * count, count) for i in range(len(transactions))
    )
    ids = tuple(each.to_bytes(2, "big") for each in transactions)
    flight = BatchInFlight(RequestBatch(EXCHANGE, None, 0, requests), 7, ids, 0.0)
    replies = bytearray(b"".join(good_reply(each, [each] * count, 7) for each in transactions))
    for where, bits in flips:
        replies[where % len(replies)] ^= bits
    stream, size = bytes(at) + bytes(replies[:length]), HEAD.size + 2 * count
    whole = [stream[first : first + size] for first in range(at, len(stream) - size + 1, size)]
    each_good = all(
        HEAD.unpack_from(reply) == (transaction, 0, 3 + 2 * count, 7, 3, 2 * count)
        for reply, transaction in zip(whole, transactions, strict=False)
    )
    taken, end, data = flight.match_replies(stream, at)
    assert taken == (len(whole) if each_good else 0)
    assert end == at + taken * size
    assert data == b"".join(reply[HEAD.size :] for reply in whole[:taken])


@given(st.integers(1, 400), st.integers(1, 125), st.data())
def test_what_is_missing_of_a_block_is_asked_for_in_batches_alike(
    count: int, step: int, data: st.DataObject
) -> None:
    block = PartialBlock(1000, count, "holding", step)
    wire = np.arange(1000, 1000 + count).astype(">u2").tobytes()
    number = -(-count // step)
    answered = data.draw(st.sets(st.integers(0, number - 1)))
    for i in answered:
        block.fill(i, 1, wire[2 * step * i : 2 * step * (i + 1)])
    assert block.missing == number - len(answered)
    asked = []
    for batch in block.batches(EXCHANGE):
        sizes = [request.reply_length - len(request.reply_prefix) for request in batch.requests]
        assert len(set(sizes)) == 1
        first, size = 2 * step * batch.first, sum(sizes)
        block.fill(batch.first, len(batch.requests), wire[first : first + size])
        asked += range(batch.first, batch.first + len(batch.requests))
    assert sorted(asked) == sorted(set(range(number)) - answered)
    assert block.missing == 0
    assert np.array_equal(block.words(), np.arange(1000, 1000 + count))


@pytest.mark.parametrize("step", [1, 16, 125])
def test_no_transaction_comes_again_before_all_others_did(step: int) -> None:
    transactions = TransactionIds()
    drawn = [transactions.draw(step) for _ in range(2 * ID_COUNT // step)]
    assert all(len(each) == step for each in drawn)
    ids = list(itertools.chain.from_iterable(drawn))
    assert len(set(ids[:ID_COUNT])) == ID_COUNT
    assert ids[ID_COUNT:] == ids[: len(ids) - ID_COUNT]


async def answered(window: int, blocks: list[PartialBlock], replies: list[bytes]) -> ModbusClient:
    """Ask for `blocks`; the peer takes `window` requests, then sends all replies at once.

    The transaction of a reply is what its own is off from that of its request, bit by bit.
    """

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        requests = [await reader.readexactly(12) for _ in range(window)]
        for request, reply in zip(requests, replies, strict=True):
            writer.write(bytes([request[0] ^ reply[0], request[1] ^ reply[1]]) + reply[2:])
        await reader.read()
        writer.close()

    async with await asyncio.start_server(serve, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        client = ModbusClient(transport_for(ModuleLink(port=port, window=window, timeout_s=2.0)))
        await client.connect()
        try:
            await client.complete(*blocks)
        finally:
            await client.close()
    return client


@pytest.mark.parametrize("byte", range(HEAD.size))
@pytest.mark.parametrize("position", [0, 3, 7])
async def test_one_wrong_head_among_many_good_ones_ends_the_connection(position: int, byte: int) -> None:
    replies = [bytearray(good_reply(0, list(range(125)))) for _ in range(8)]
    block = PartialBlock(0, 1000, "holding", 125)
    replies[position][byte] ^= 0x21
    with pytest.raises((ProtocolError, LinkError)):
        await answered(8, [block], [bytes(each) for each in replies])
    assert block.missing >= 8 - position


async def test_a_reply_that_comes_after_its_exchange_has_ended_is_not_used() -> None:
    blocks = [PartialBlock(0, 250, "holding", 125), PartialBlock(500, 10, "holding", 125)]
    good, late = good_reply(0, [1] * 125), good_reply(0, [2] * 10)
    refused = bytes.fromhex("0000 0000 0003 01 83 04")
    with pytest.raises(ModbusExceptionError, match="server device failure"):
        await answered(3, blocks, [good, refused, late])
    assert [block.missing for block in blocks] == [1, 1]
    assert blocks[0].words()[:125].tolist() == [1] * 125
    assert not blocks[1].words().any()


async def test_a_transaction_in_flight_is_not_given_to_another_request() -> None:
    seen: list[bytes] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        seen.extend([(await reader.readexactly(12))[:2] for _ in range(2)])
        writer.close()

    class Repeating(TransactionIds):
        def draw(self, count: int) -> tuple[bytes, ...]:
            ids = super().draw(count)
            self._next -= count * (len(drawn) < 2)
            drawn.append(ids)
            return ids

    drawn: list[tuple[bytes, ...]] = []
    async with await asyncio.start_server(serve, "127.0.0.1", 0) as server:
        client = ModbusClient(transport_for(ModuleLink(port=server.sockets[0].getsockname()[1], window=2)))
        client._transport._transaction_ids = Repeating()
        await client.connect()
        reads = await asyncio.gather(client.read(0, 1), client.read(9, 1), return_exceptions=True)
        await client.close()
    assert all(isinstance(each, LinkError) for each in reads)
    assert drawn[0] == drawn[1]
    assert len(set(seen)) == 2


@pytest.mark.skipif(not hasattr(socket, "TCP_QUICKACK"), reason="the system has no quick acknowledgements")
async def test_a_peer_that_holds_back_small_replies_is_not_waited_for() -> None:
    """It sends each reply by itself, the next only once that is acknowledged, which may take 40 ms."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            link, _ = server.accept()
            with link, link.makefile("rb") as requests:
                while request := requests.read(12):
                    transaction, count = struct.unpack(">H8xH", request)
                    link.sendall(good_reply(transaction, [count] * count))

        thread = threading.Thread(target=serve)
        thread.start()
        client = ModbusClient(
            transport_for(ModuleLink(port=server.getsockname()[1], window=4, timeout_s=5.0))
        )
        await client.connect()
        loop, taken_s = asyncio.get_running_loop(), []
        for _ in range(30):
            started_s = loop.time()
            await client.read(0, 500)
            taken_s.append(loop.time() - started_s)
        await client.close()
        thread.join()
    assert min(taken_s[20:]) < 0.02  # a fresh connection is quick by itself


@pytest.mark.parametrize(("count", "sizes"), [(122, [122]), (123, [123]), (124, [123, 1]), (246, [123, 123])])
def test_neighbours_are_written_together_as_many_as_a_request_can_hold(count: int, sizes: list[int]) -> None:
    """At most 123 registers (Modbus Application Protocol V1.1b3, 6.12)."""
    registers: Any = [
        SimpleNamespace(bit=None, table="holding", address=40 + place, end=41 + place)
        for place in range(count)
    ]
    runs = register_client._adjacent_runs(registers)
    assert [len(run) for run in runs] == sizes
    assert [register for run in runs for register in run] == registers
