"""Faults of a module, of the network before it, and of its power, drawn with a seed: 47 kinds."""

import asyncio
import contextlib
import random
from collections import Counter, deque
from typing import Final

import numpy as np

from impactcell.fieldbus.registers import RegisterMap, Words
from simulator.faults import FaultKind
from simulator.scripted import ScriptedDevice

ANYWHERE: Final = ("zeros", "ones", "swapped_words", "shifted_words")
REGIONS: Final = {
    "identity": ("flip_identity",),
    "status": ("flip_status", "stale_status", "very_stale_status", *ANYWHERE),
    "header": ("flip_header", "stale_header", *ANYWHERE),
    "samples": ("flip_samples", "stale_samples", "other_client", *ANYWHERE),
    "after": ("flip_sequence_after",),
    "select": ("lost_write",),
}
"""What may befall a reading or writing, by what is read or written."""
ON_THE_WIRE: Final = (
    *("inserted_byte", "dropped_byte", "garbage_before", "garbage_after", "flipped_mbap"),
    *("dribble", "half_close", "replayed_frame", "swapped_frames", "cut_and_glued"),
)
REBOOTS: Final = (
    *("reboot_new_session", "reboot_same_session", "reboot_counter_kept", "reboot_counter_set"),
    "reboot_unread",
)
KINDS: Final = (
    *FaultKind,
    *dict.fromkeys(kind for kinds in REGIONS.values() for kind in kinds),
    *ON_THE_WIRE,
    *REBOOTS,
)
STALE_POLLS: Final = 3
"""So many readings of the status block running are old."""


class FaultPlan:
    """Draws what befalls which exchange, and counts it."""

    def __init__(self, seed: int, probability: float) -> None:
        self.random = random.Random(seed)
        self.happened: Counter[str] = Counter()
        self.probability = probability
        self.quiet = False

    def draw(self, kinds: tuple[str, ...]) -> str | None:
        """Give the kind of fault that happens now, mostly none."""
        if self.quiet or self.random.random() >= self.probability:
            return None
        kind = self.random.choice(kinds)
        self.happened[kind] += 1
        return kind


class FaultyDevice:
    """A module whose memory and bus lie now and then."""

    def __init__(self, device: ScriptedDevice, plan: FaultPlan) -> None:
        self.device = device
        self._plan = plan
        self._registers: RegisterMap = device.registers
        self._past: deque[Words] = deque(maxlen=6)
        self._stale: tuple[int, int] = (0, 0)

    def remember(self) -> None:
        """Keep what is shown now, to be shown again when it is old."""
        status = self._registers["state"].address
        self.device.read("holding", status, self._registers["status_crc32"].end - status)
        self._past.append(self.device.image.copy())

    def write(self, address: int, words: Words) -> None:
        """Write, or say so."""
        select = self._registers["slot_select"].address
        if address <= select < address + words.size and self._plan.draw(REGIONS["select"]):
            return
        self.device.write(address, words)

    def read(self, table: str, address: int, count: int) -> Words:
        """Read, or something like it."""
        words = self.device.read(table, address, count).copy()
        region = self._region(address)
        if region == "status" and self._stale[0] and self._past:
            self._stale = self._stale[0] - 1, self._stale[1]
            return self._shown_before(address, count, self._stale[1])
        kind = self._plan.draw(REGIONS.get(region, ANYWHERE))
        draw = self._plan.random
        if kind is None:
            return words
        if kind.startswith("flip"):
            words[draw.randrange(count)] ^= np.uint16(1 << draw.randrange(16))
        elif kind.startswith(("stale", "very")) and self._past:
            age = len(self._past) if kind.startswith("very") else min(2, len(self._past))
            if region == "status":
                self._stale = STALE_POLLS - 1, age
            return self._shown_before(address, count, age)
        elif kind == "other_client":
            self.device.write(self._registers["slot_select"].address, np.array([draw.randrange(16)]))
        elif kind == "zeros":
            words[:] = 0
        elif kind == "ones":
            words[:] = 0xFFFF
        elif kind == "swapped_words":
            words = words[::-1].copy()
        elif kind == "shifted_words":
            words = np.roll(words, 1)
        return words

    def _shown_before(self, address: int, count: int, age: int) -> Words:
        return self._past[-age][address : address + count].copy()

    def _region(self, address: int) -> str:
        registers = self._registers
        if address < registers["state"].address:
            return "identity"
        if address < registers["status_crc32"].end:
            return "status"
        if address < registers["force"].address:
            return "header" if address >= registers["window_sequence"].address else ""
        return "after" if address == registers["window_sequence_after"].address else "samples"


class FaultyWire:
    """A relay between client and server that does not keep replies as they are."""

    def __init__(self, port: int, plan: FaultPlan) -> None:
        self._port = port
        self._plan = plan
        self._tasks: set[asyncio.Task[None]] = set()
        self._writers: set[asyncio.StreamWriter] = set()
        self.port = 0
        self._server: asyncio.Server | None = None

    async def start(self) -> None:
        """Listen on a free port."""
        self._server = await asyncio.start_server(self._relay, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        """Drop all."""
        assert self._server is not None
        self._server.close()
        for writer in list(self._writers):
            writer.transport.abort()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._server.wait_closed()

    async def _relay(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        self._writers.add(writer)
        with contextlib.suppress(OSError, asyncio.IncompleteReadError, asyncio.CancelledError):
            there, out = await asyncio.open_connection("127.0.0.1", self._port)
            requests = asyncio.create_task(self._requests(reader, out))
            try:
                await self._replies(there, writer)
            finally:
                requests.cancel()
                await asyncio.gather(requests, return_exceptions=True)
                out.transport.abort()
        writer.transport.abort()
        self._writers.discard(writer)
        self._tasks.discard(task)

    async def _requests(self, reader: asyncio.StreamReader, out: asyncio.StreamWriter) -> None:
        while data := await reader.read(65_536):
            out.write(data)
        out.transport.abort()

    async def _replies(self, there: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        before = b""
        held = b""
        while True:
            head = await there.readexactly(6)
            frame = head + await there.readexactly(int.from_bytes(head[4:6]))
            kind = self._plan.draw(ON_THE_WIRE)
            if kind == "half_close":
                writer.write(frame[: self._plan.random.randrange(len(frame))])
                writer.write_eof()
                await there.read()
                return
            if kind == "swapped_frames":
                held, before = frame, before
                continue
            if kind == "dribble":
                for byte in frame:
                    writer.write(bytes([byte]))
                    await asyncio.sleep(0)
            else:
                writer.write(frame if kind is None else self._changed(kind, frame, before))
            writer.write(held)
            held, before = b"", frame

    def _changed(self, kind: str, frame: bytes, before: bytes) -> bytes:
        draw = self._plan.random
        at = draw.randrange(len(frame))
        match kind:
            case "inserted_byte":
                return frame[:at] + draw.randbytes(1) + frame[at:]
            case "dropped_byte":
                return frame[:at] + frame[at + 1 :]
            case "garbage_before":
                return draw.randbytes(draw.randrange(1, 20)) + frame
            case "garbage_after":
                return frame + draw.randbytes(draw.randrange(1, 20))
            case "flipped_mbap":
                at = draw.randrange(9)
                return frame[:at] + bytes([frame[at] ^ 1 << draw.randrange(8)]) + frame[at + 1 :]
            case "replayed_frame":
                return before + frame
            case _:  # cut_and_glued
                return frame[:at] + before
