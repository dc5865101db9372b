"""One capture, read through the module's window so that it is never a mixture of two.

The window shows one slot of the ring. Its sequence number is read before and after the samples: only if it is
even and has not changed, if slot, session and cycle are the wanted ones and the CRC fits, is the reading
used. A reading that the link interrupts is taken up where it stopped, if the window still shows the same and
there is a CRC to prove the whole.
"""

import asyncio
from dataclasses import dataclass
from typing import Final

from impactcell.errors import FieldbusError, ModbusExceptionError, ProtocolError
from impactcell.fieldbus import decoding
from impactcell.fieldbus.capture_ring import Want
from impactcell.fieldbus.register_client import MappedDevice
from impactcell.fieldbus.registers import Value, Words, capture_crc32
from impactcell.fieldbus.request_batching import PartialBlock
from impactcell.records import Capture

_ATTEMPTS: Final = 5
"""Readings of one cycle that may be discarded before it is given up."""
_BREAKS: Final = 30
"""Times that the link may fail on one cycle, without getting further, before it is given up."""
_PAUSE_S: Final = 0.001
"""Rest after the first discarded reading, doubled with each: the module may be writing the slot."""
_REFUSED: Final = (1, 2, 3)
"""Exceptions that the request earns; all others tell of a module, or a gateway, that cannot answer now."""
_ARRAYS: Final = ("force", "position", "actuator")


@dataclass(frozen=True, slots=True, eq=False)
class ReadCapture:
    """What came of reading one cycle.

    Attributes
    ----------
    readable : bool
        False if it has no content but its number.
    faults : tuple of str
        What is wrong; each names cell, cycle and register.
    """

    capture: Capture
    readable: bool
    faults: tuple[str, ...]


@dataclass(slots=True, eq=False)
class _Reading:
    """A capture as far as it has been read."""

    want: Want
    header: dict[str, Value]
    words: Words
    blocks: dict[str, PartialBlock]

    @property
    def lacking(self) -> int:
        return sum(block.missing for block in self.blocks.values())


class CaptureReader:
    """Reads captures of one module.

    Attributes
    ----------
    discarded : int
        Readings thrown away because the capture changed meanwhile or did not fit its CRC.
    """

    def __init__(self, cell: str, device: MappedDevice) -> None:
        self.discarded = 0
        self._cell = cell
        self._device = device
        self._registers = device.registers
        self._reading: _Reading | None = None
        self._failing: Want | None = None
        self._failures = 0
        self._breaks = 0
        self._least = 0

    async def fetch(self, want: Want) -> ReadCapture | None:
        """Read the cycle `want`; None if it was overwritten before it could be read.

        A cycle that cannot be read however often it is tried comes back without content, and `faults` says
        why.

        Raises
        ------
        LinkError, ProtocolError, ModbusExceptionError
            If the link fails, or the module cannot answer now; the next call for the same cycle goes on where
            this one stopped.
        """
        if self._failing is None or self._failing.mark != want.mark:
            self._failing, self._failures, self._breaks, self._reading = want, 0, 0, None
        reason = "it kept changing while it was read; does another client select slots?"
        while self._failures < _ATTEMPTS:
            try:
                reading = await self._begin(want)
                if reading is None:
                    self._failures += 1
                    reason = f"slot {want.slot} does not show it, although ring_cycle says so"
                    if self._failures < _ATTEMPTS:
                        return None
                    break
                fault = await self._finish(reading)
                if fault is None:
                    self._failing = self._reading = None
                    return self._put_together(reading)
                reason = fault
            except FieldbusError as error:
                progressed = self._progressed()
                if isinstance(error, ModbusExceptionError) and (progressed or error.code in _REFUSED):
                    reason = str(error)
                    if progressed:
                        continue
                else:
                    self._breaks += not progressed
                    if isinstance(error, ProtocolError) or "capture_crc32" not in self._registers:
                        self._reading = None  # what came before the fault may be wrong too
                    if self._breaks < _BREAKS:
                        raise
                    reason = f"the link failed each time: {error}"
                    break
            self._reading = None
            self._failures += 1
            self.discarded += 1
            await asyncio.sleep(_PAUSE_S * 2**self._failures)
        self._failing = self._reading = None
        fault = f"{self._cell}: cycle {want.mark.cycle} could not be read: {reason}"
        return ReadCapture(decoding.blank(want.mark.cycle), readable=False, faults=(fault,))

    def _progressed(self) -> bool:
        """Whether the interrupted reading got further than the one before."""
        if self._reading is None:
            return False
        before, self._least = self._least, self._reading.lacking
        return self._least < before

    async def _begin(self, want: Want) -> _Reading | None:
        """Show the slot and read its header, or go on with the reading that was interrupted."""
        device, registers = self._device, self._registers
        if self._reading is not None:
            _, words = await device.header()
            if words.tobytes() == self._reading.words.tobytes():
                return self._reading
            self._reading = None
            self.discarded += 1
        header, words = await device.header(want.slot)
        if header["window_slot"] != want.slot:
            header, words = await device.header()
        if _even(header["window_sequence"]) and header["window_slot"] == want.slot:
            shown = (header["window_session"], header["window_cycle"])
            if shown != (want.mark.session, want.mark.cycle):
                return None
        counts = decoding.used_counts(registers, header)
        blocks = {name: device.part(name, count) for name, count in counts.items()}
        self._reading = _Reading(want, header, words, blocks)
        self._least = self._reading.lacking
        return self._reading

    async def _finish(self, reading: _Reading) -> str | None:
        """Read the samples and what follows them; return why the reading is of no use, None if it is good."""
        registers, header, want = self._registers, reading.header, reading.want
        before = header["window_sequence"]
        shown = (header["window_slot"], header["window_session"], header["window_cycle"])
        if not _even(before):
            return f"register window_sequence shows {before}: the window was being changed"
        if shown != (want.slot, want.mark.session, want.mark.cycle):
            address = registers["window_slot"].address
            return f"register window_slot ({address}) shows {shown[0]} instead of {want.slot}"
        complete, last = self._device.client.complete, self._device.part("window_sequence_after", 1)
        provable = "capture_crc32" in registers and not decoding.lying_counts(registers, header)
        if provable:  # in whatever order the device answers
            await complete(*reading.blocks.values(), last)
        else:
            await complete(*reading.blocks.values())
            await complete(last)
        after = registers["window_sequence_after"].decode(last.words())
        if before != after:
            return f"register window_sequence changed from {before} to {after} meanwhile"
        if provable:
            crc = registers["capture_crc32"]
            first = registers["window_sequence"]
            covered = reading.words[first.words : crc.address - first.address]
            samples = [reading.blocks[name].words() for name in _ARRAYS if name in reading.blocks]
            if header["capture_crc32"] != capture_crc32(covered, *samples):
                return f"register capture_crc32 ({crc.address}) does not fit what was read"
        return None

    def _put_together(self, reading: _Reading) -> ReadCapture:
        samples = {name: block.words() for name, block in reading.blocks.items()}
        capture, faults = decoding.capture(self._registers, reading.header, samples)
        named = tuple(f"{self._cell}: cycle {capture.cycle}: {fault}" for fault in faults)
        return ReadCapture(capture, readable=True, faults=named)


def _even(sequence: Value) -> bool:
    """Whether the window was at rest."""
    return isinstance(sequence, int) and sequence % 2 == 0
