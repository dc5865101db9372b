"""One capture, read through the module's window so that it is never a mixture of two.

The window shows one slot of the ring. Its sequence number is read before and after the samples: only if it is
even and has not changed, if slot, session and cycle are the wanted ones and the CRC fits, is the reading
used. A reading that the link interrupts is taken up where it stopped, if the window still shows the same and
there is a CRC to prove the whole.
"""

import asyncio
import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from impactcell.errors import FieldbusError, ModbusExceptionError, ProtocolError
from impactcell.fieldbus import decoding
from impactcell.fieldbus.capture_ring import NextCapture, cycles_after, is_after
from impactcell.fieldbus.register_client import RegisterClient
from impactcell.fieldbus.register_image import RegisterImage
from impactcell.fieldbus.registers import Value, Words, registers_crc32
from impactcell.fieldbus.request_batching import PartialBlock
from impactcell.fieldbus.taken_cycles import TakenCycles
from impactcell.records import Capture, CycleId

_AT_ONCE: Final = 5
"""Readings of one cycle that may be discarded one after the other; then the status block is looked at."""
_MOST_ATTEMPTS: Final = 16
"""Readings of one cycle that may be discarded before it is given up though the ring has it: some 2.5 s, for
which all later ones wait."""
_MOST_LINK_FAILURES: Final = 30
"""Times that the link may fail on one cycle, without getting further, before it is given up."""
_PAUSE_S, _LONGEST_PAUSE_S = 0.001, 0.25
"""Rest after the first discarded reading, doubled with each up to the second: the module may be writing the
slot, or another client be selecting others."""
_REQUEST_FAULTS: Final = (1, 2, 3)
"""Exceptions that the request earns; all others tell of a module, or a gateway, that cannot answer now."""
_ARRAYS: Final = ("force", "position", "actuator")


class NotFetched(enum.Enum):
    """Why a cycle was not read although the status block has it; none of these is a fault of the link."""

    OVERWRITTEN = "the module has put a newer cycle in its place"
    NOT_SHOWN = "its slot shows another cycle: the status block is wrong, or the window"
    TAKEN = "it has been taken before: the status block is old, or wrong"
    NOT_YET = "no reading of it was of use yet; the ring still holds it"


@dataclass(frozen=True, slots=True, eq=False)
class FetchedCapture:
    """What came of reading one cycle.

    Attributes
    ----------
    header : bytes
        Words of the header, for telling whether the same is read again; empty where there was none.
    readable : bool
        False if it has no content but its number.
    faults : tuple of str
        What is wrong; each names cell, cycle and register.
    """

    capture: Capture
    header: bytes
    readable: bool
    faults: tuple[str, ...]


@dataclass(slots=True, eq=False)
class _PartialCapture:
    """A capture as far as it has been read."""

    target: NextCapture
    header: Mapping[str, Value]
    words: Words
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
    """

    def __init__(self, cell: str, client: RegisterClient) -> None:
        self.discarded = 0
        self._cell = cell
        self._client = client
        self._registers = client.registers
        self._partial: _PartialCapture | None = None
        self._target: NextCapture | None = None
        self._attempts = 0
        self._link_failures = 0
        self._fewest_missing = 0

    async def fetch(self, target: NextCapture, taken: TakenCycles) -> FetchedCapture | NotFetched:
        """Read the cycle `target`, if that is what its slot shows and it has not been taken before.

        A cycle that cannot be read however often it is tried, or not before others behind it would be lost,
        comes back without content, and `faults` says why.

        Raises
        ------
        LinkError, ProtocolError, ModbusExceptionError
            If the link fails, or the module cannot answer now; the next call for the same cycle goes on where
            this one stopped.
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
                if isinstance(error, ModbusExceptionError) and (progressed or error.code in _REQUEST_FAULTS):
                    reason = str(error)
                    if progressed:
                        continue
                else:
                    self._link_failures += not progressed
                    if isinstance(error, ProtocolError) or "capture_crc32" not in self._registers:
                        self._partial = None  # what came before the fault may be wrong too
                    if self._link_failures < _MOST_LINK_FAILURES:
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
        return cycles_after(target.cycle_id.cycle, target.counter) >= self._registers.slots // 2

    def _progressed(self) -> bool:
        """Whether the interrupted reading got further than the one before."""
        if self._partial is None:
            return False
        before, self._fewest_missing = self._fewest_missing, self._partial.missing_requests
        return self._fewest_missing < before

    async def _read_header(self, target: NextCapture, taken: TakenCycles) -> _PartialCapture | NotFetched:
        """Show the slot and read its header, or go on with the reading that was interrupted."""
        client, registers = self._client, self._registers
        if self._partial is not None:
            words = self._words(await client.read_header())
            if words.tobytes() == self._partial.words.tobytes():
                return self._partial
            self._partial = None
            self.discarded += 1
        image = await client.read_header(target.slot)
        if image.values["window_slot"] != target.slot:
            image = await client.read_header()
        header, words = image.values, self._words(image)
        if _at_rest(header["window_sequence"]) and header["window_slot"] == target.slot:
            integer, wanted = decoding.integer, target.cycle_id
            shown = CycleId(integer(header["window_session"]), integer(header["window_cycle"]))
            if taken.holds(shown, self._identifying(words), integer(header["cycle_time"]), target):
                return NotFetched.TAKEN
            if shown != wanted:
                newer = shown.session == wanted.session and is_after(shown.cycle, wanted.cycle)
                return NotFetched.OVERWRITTEN if newer else NotFetched.NOT_SHOWN
        counts = decoding.sample_counts(registers, header)
        blocks = {name: client.partial_block(name, count) for name, count in counts.items()}
        self._partial = _PartialCapture(target, header, words, blocks)
        self._fewest_missing = self._partial.missing_requests
        return self._partial

    def _words(self, image: RegisterImage) -> Words:
        return image.words(self._registers["window_sequence"], self._registers.header()[-1].end)

    def _identifying(self, words: Words) -> bytes:
        """Words of a header that stay the same while its capture does."""
        return words[self._registers["window_sequence"].words :].tobytes()

    async def _read_samples(self, partial: _PartialCapture) -> str | None:
        """Read the samples and what follows them; return why the reading is of no use, None if it is good."""
        registers, header, target = self._registers, partial.header, partial.target
        before = header["window_sequence"]
        identity = (header["window_slot"], header["window_session"], header["window_cycle"])
        if not _at_rest(before):
            return f"register window_sequence shows {before}: the window was being changed"
        if identity != (target.slot, target.cycle_id.session, target.cycle_id.cycle):
            address = registers["window_slot"].address
            return f"register window_slot ({address}) shows {identity[0]} instead of {target.slot}"
        provable = "capture_crc32" in registers
        if provable and (excessive := decoding.excessive_counts(registers, header)):
            return excessive[0]  # no CRC can cover samples that the map has no room for
        complete, last = self._client.modbus.complete, self._client.partial_block("window_sequence_after", 1)
        if provable:  # in whatever order the device answers
            await complete(*partial.blocks.values(), last)
        else:
            await complete(*partial.blocks.values())
            await complete(last)
        after = registers["window_sequence_after"].decode(last.words())
        if before != after:
            return f"register window_sequence changed from {before} to {after} meanwhile"
        if provable:
            crc = registers["capture_crc32"]
            first = registers["window_sequence"]
            covered = partial.words[first.words : crc.address - first.address]
            samples = [partial.blocks[name].words() for name in _ARRAYS if name in partial.blocks]
            if header["capture_crc32"] != registers_crc32(covered, *samples):
                return f"register capture_crc32 ({crc.address}) does not fit what was read"
        return None

    def _assemble(self, partial: _PartialCapture) -> FetchedCapture:
        samples = {name: block.words() for name, block in partial.blocks.items()}
        capture, faults = decoding.capture_from_words(self._registers, partial.header, samples)
        identifying = self._identifying(partial.words)
        named = tuple(f"{self._cell}: cycle {capture.cycle}: {fault}" for fault in faults)
        return FetchedCapture(capture, identifying, readable=True, faults=named)


def _at_rest(sequence: Value) -> bool:
    """Whether the window was at rest."""
    return isinstance(sequence, int) and sequence % 2 == 0
