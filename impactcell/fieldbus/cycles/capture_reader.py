"""One capture, read through the module's window so that it is never a mixture of two.

The window shows one slot of the ring, or the one buffer of the module. Its sequence number is read before and
after the samples: only if it is even and has not changed, if slot, session and cycle are the wanted ones and
the CRC fits, is the reading used. Of a module that has neither sequence number nor CRC each capture is read
twice, and used where both readings agree. A reading that the link interrupts is taken up where it stopped, if
the window still shows the same and there is a CRC to prove the whole.
"""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from impactcell.errors import FieldbusError, ModbusExceptionError, NotDecimalError, ProtocolError
from impactcell.fieldbus.cycles import decoding
from impactcell.fieldbus.cycles.capture_header import CaptureHeader, at_rest
from impactcell.fieldbus.cycles.capture_ring import NextCapture, cycles_after, is_after
from impactcell.fieldbus.cycles.cycle_numbers import CycleNumbers
from impactcell.fieldbus.cycles.fetched_capture import FetchedCapture, NotFetched
from impactcell.fieldbus.cycles.status_block import integer
from impactcell.fieldbus.cycles.taken_cycles import TakenCycles
from impactcell.fieldbus.register_client import RegisterClient
from impactcell.fieldbus.register_image import RegisterImage
from impactcell.fieldbus.registers import WIRE, Value, Words, registers_crc32
from impactcell.fieldbus.request_batching import PartialBlock

_AT_ONCE: Final = 5
"""Readings of one cycle that may be discarded one after the other; then the status block is looked at."""
_MOST_ATTEMPTS: Final = 16
"""Readings of one cycle that may be discarded before it is given up though the ring has it: some 2.5 s, for
which all later ones wait."""
_MOST_LINK_FAILURES: Final = 40
"""Times that the link may fail on one cycle, without getting further, before it is given up though the ring
has it: with the growing pauses between them some ten seconds, in which a gateway or a module has started."""
_URGENT_LINK_FAILURES: Final = 14
"""The same, where the ring is about to overwrite the cycle and those behind it: some three seconds."""
_PAUSE_S, _LONGEST_PAUSE_S = 0.001, 0.25
"""Rest after the first discarded reading, doubled with each up to the second: the module may be writing the
slot, or another client be selecting others."""
_REQUEST_FAULTS: Final = (1, 2, 3)
"""Exceptions that the request earns; all others tell of a module, or a gateway, that cannot answer now."""


@dataclass(slots=True, eq=False)
class _PartialCapture:
    """A capture as far as it has been read."""

    target: NextCapture
    header: Mapping[str, Value]
    identity: bytes
    covered: Words
    blocks: dict[str, PartialBlock]

    @property
    def missing_requests(self) -> int:
        return sum(block.missing for block in self.blocks.values())


class CaptureReader:
    """Reads captures of one module.

    Attributes
    ----------
    discarded : int
        Readings thrown away because the capture changed meanwhile or did not fit its CRC.
    numbers : CycleNumbers
        How the module counts its cycles.
    """

    def __init__(self, cell: str, client: RegisterClient) -> None:
        self.discarded = 0
        self._cell = cell
        self._client = client
        self._registers = client.registers
        self.numbers = CycleNumbers.of(client.registers["cycle_counter"].kind)
        self._header = CaptureHeader(client.registers, self.numbers)
        self._partial: _PartialCapture | None = None
        self._target: NextCapture | None = None
        self._attempts = 0
        self._link_failures = 0
        self._fewest_missing = 0

    async def fetch(self, target: NextCapture, taken: TakenCycles) -> FetchedCapture | NotFetched:
        """Read the cycle `target`, if that is what its slot shows and it has not been taken before.

        A cycle that cannot be read however often it is tried, or not before others behind it would be lost,
        comes back without content, and `faults` says why. One of a module that was started anew has the
        number that its counter shows.

        Raises
        ------
        LinkError, ProtocolError, ModbusExceptionError
            If link or module fail now; the next call for the same cycle goes on where this one stopped.
        """
        if self._target is None or self._target.cycle_id != target.cycle_id:
            self._target, self._attempts, self._link_failures, self._partial = target, 0, 0, None
        reason = "it kept changing while it was read; does another client select slots?"
        while True:
            try:
                partial = await self._read_header(target, taken)
                if isinstance(partial, NotFetched):
                    return partial
                fault = await self._read_samples(partial)
                if fault is None:
                    self._target = self._partial = None
                    return self._assemble(partial)
                reason = fault
            except FieldbusError as error:
                progressed = self._progressed()
                if _is_of_request(error, progressed=progressed):
                    reason = str(error)
                    if progressed:
                        continue
                else:
                    if isinstance(error, ProtocolError) or "capture_crc32" not in self._registers:
                        self._partial, progressed = None, False  # what came before may be wrong too
                    self._link_failures += not progressed
                    if self._link_failures < self._most_link_failures(target):
                        raise
                    reason = f"the link failed each time: {error}"
                    break
            self._partial = None
            self._attempts += 1
            self.discarded += 1
            await asyncio.sleep(min(_PAUSE_S * 2**self._attempts, _LONGEST_PAUSE_S))
            if self._attempts >= _MOST_ATTEMPTS or (self._attempts >= _AT_ONCE and self._is_urgent(target)):
                break
            if self._attempts >= _AT_ONCE:
                return NotFetched.NOT_YET
        self._target = self._partial = None
        if taken.is_behind(target.cycle_id):  # no header has proved that there is such a cycle at all
            return NotFetched.NOT_SHOWN
        cycle = target.cycle_id.cycle
        fault = f"{self._cell}: cycle {cycle} could not be read: {reason}"
        return FetchedCapture(decoding.empty_capture(cycle), b"", readable=False, faults=(fault,))

    def _is_urgent(self, target: NextCapture) -> bool:
        """Whether so many newer ones wait in the ring that they would be lost for this one."""
        return _waiting_behind(target) >= max(1, self._registers.slots // 2)  # nobody waits behind one buffer

    def _most_link_failures(self, target: NextCapture) -> int:
        """How often the link may fail on a cycle: it mostly fails on all, and giving one up wins nothing."""
        about_to_go = _waiting_behind(target) >= max(1, self._registers.slots - 2)
        return _URGENT_LINK_FAILURES if about_to_go else _MOST_LINK_FAILURES

    def _progressed(self) -> bool:
        """Whether the interrupted reading got further than the one before."""
        if self._partial is None:
            return False
        before, self._fewest_missing = self._fewest_missing, self._partial.missing_requests
        return self._fewest_missing < before

    async def _read_header(self, target: NextCapture, taken: TakenCycles) -> _PartialCapture | NotFetched:
        """Show the slot and read its header, or go on with the reading that was interrupted."""
        client = self._client
        if self._partial is not None:
            image, partial = await client.read_header(), self._partial
            same_sequence = image.values.get("window_sequence") == partial.header.get("window_sequence")
            if same_sequence and self._header.identity(image) == partial.identity:
                return partial
            self._partial = None
            self.discarded += 1
        image = await client.read_header(target.slot)
        if image.values.get("window_slot", target.slot) != target.slot:
            image = await client.read_header()
        header, identity = image.values, self._header.identity(image)
        if self._is_none_since_start(target, header):
            return NotFetched.NOT_MADE
        if at_rest(header) and header.get("window_slot", target.slot) == target.slot:
            wanted, shown = target.cycle_id, self._header.shown(header, target.cycle_id)
            if taken.holds(shown, identity, integer(header.get("cycle_time", 0)), target):
                return NotFetched.TAKEN
            if shown != wanted:
                newer = shown.session == wanted.session and is_after(shown.cycle, wanted.cycle)
                return NotFetched.OVERWRITTEN if newer else NotFetched.NOT_SHOWN
            if target.restarted:
                target = self.numbers.of_new_life(target)
        self._partial = _PartialCapture(target, header, identity, self._covered(image), self._blocks(header))
        self._fewest_missing = self._partial.missing_requests
        return self._partial

    def _is_none_since_start(self, target: NextCapture, header: Mapping[str, Value]) -> bool:
        """Whether a counter that shows 0 has not gone round: nothing tells but that there is no tap."""
        cycle_id = target.cycle_id
        return not (cycle_id.session or self.numbers.shown(cycle_id.cycle) or decoding.tells_of_a_tap(header))

    def _blocks(self, header: Mapping[str, Value], *, again: bool = False) -> dict[str, PartialBlock]:
        counts = decoding.sample_counts(self._registers, header)
        return {n: self._client.partial_block(n, count, again=again) for n, count in counts.items()}

    def _covered(self, image: RegisterImage) -> Words:
        """Words of a header that its CRC covers."""
        crc = self._registers.registers.get("capture_crc32")
        return np.zeros(0, WIRE) if crc is None else image.words(self._registers.covered(), crc.address)

    async def _read_samples(self, partial: _PartialCapture) -> str | None:
        """Read the samples and what proves them; return why the reading is of no use, None if it is good."""
        registers, header, target = self._registers, partial.header, partial.target
        if not at_rest(header):
            return "the module was changing its window"
        slot = header.get("window_slot", target.slot)
        if (slot, self._header.shown(header, target.cycle_id)) != (target.slot, target.cycle_id):
            name = "window_slot" if "window_slot" in registers else "window_cycle"
            return f"register {name} ({registers[name].address}) shows {header[name]}, which is not asked for"
        provable = "capture_crc32" in registers
        if provable and (excessive := decoding.excessive_counts(registers, header)):
            return next(iter(excessive.values()))  # no CRC can cover samples that the map has no room for
        if "window_sequence" in registers:
            fault = await self._read_watched(partial, at_once=provable)
        elif not provable:
            fault = await self._read_twice(partial)
        else:
            fault = None
            await self._client.modbus.complete(*partial.blocks.values())
        if fault is None and provable:
            crc = registers["capture_crc32"]
            samples = [partial.blocks[name].words() for name in registers.arrays]
            if header["capture_crc32"] != registers_crc32(partial.covered, *samples):
                return f"register capture_crc32 ({crc.address}) does not fit what was read"
        return fault

    async def _read_watched(self, partial: _PartialCapture, *, at_once: bool) -> str | None:
        """Read the samples between two looks at the sequence number; `at_once`, a CRC proves their order."""
        complete = self._client.modbus.complete
        last = self._client.partial_block("window_sequence_after", 1)
        if at_once:  # in whatever order the device answers
            await complete(*partial.blocks.values(), last)
        else:
            await complete(*partial.blocks.values())
            await complete(last)
        before = partial.header["window_sequence"]
        after = self._registers["window_sequence_after"].decode(last.words())
        if before == after:
            return None
        return f"register window_sequence changed from {before} to {after} meanwhile"

    async def _read_twice(self, partial: _PartialCapture) -> str | None:
        """Read the samples, then samples and header once more, for nothing else proves them.

        In other requests: on a line without transactions a reply may be that to the request before, both
        times.
        """
        again = self._blocks(partial.header, again=True)
        await self._client.modbus.complete(*partial.blocks.values())
        await self._client.modbus.complete(*again.values())
        image = await self._client.read_header()
        agree = all(again[name].words().tobytes() == partial.blocks[name].words().tobytes() for name in again)
        if agree and at_rest(image.values) and self._header.identity(image) == partial.identity:
            return None
        return "two readings of it differ: the module was changing it"

    def _assemble(self, partial: _PartialCapture) -> FetchedCapture:
        samples = {name: block.words() for name, block in partial.blocks.items()}
        capture, faults = decoding.capture_from_words(self._registers, partial.header, samples)
        capture = replace(capture, cycle=partial.target.cycle_id.cycle)
        named = tuple(f"{self._cell}: cycle {capture.cycle}: {fault}" for fault in faults)
        return FetchedCapture(capture, partial.identity, readable=True, faults=named)


def _waiting_behind(target: NextCapture) -> int:
    """How many newer cycles wait in the ring."""
    return cycles_after(target.cycle_id.cycle, target.counter)


def _is_of_request(error: FieldbusError, *, progressed: bool) -> bool:
    """Whether the fault lies in what was asked for, and not in the link, or in a module that is busy."""
    code = error.code if isinstance(error, ModbusExceptionError) else None
    return isinstance(error, NotDecimalError) or code in _REQUEST_FAULTS or bool(code and progressed)
