"""One look at a live module: who it is, what it says, and one tap of it; nothing is acknowledged."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from impactcell.errors import FieldbusError, LinkError
from impactcell.fieldbus.acquisition import ModuleAcquisition
from impactcell.fieldbus.cycles.capture_reader import CaptureReader
from impactcell.fieldbus.cycles.capture_ring import NextCapture
from impactcell.fieldbus.cycles.fetched_capture import NotFetched
from impactcell.fieldbus.cycles.status_block import StatusBlock
from impactcell.fieldbus.cycles.taken_cycles import TakenCycles
from impactcell.fieldbus.registers import Value
from impactcell.records import Capture, CycleId

IDENTITY: Final = ("module_name", "serial_number", "map_version", "firmware_version")
"""Registers that say who the module is, where the map has them."""

MOST_LOOKS: Final = 5
"""Looks at the newest cycle where each time a newer one takes its place: taps come no faster than reading."""


@dataclass(frozen=True, slots=True, eq=False)
class ProbeResult:
    """What a module showed.

    Attributes
    ----------
    identity : mapping
        Of `IDENTITY`, by name.
    identification : mapping
        What the device says to function 43/14; empty where it does not know that.
    status : StatusBlock
    round_trip_s : float
        Of the last request.
    window : str
        Requests in flight at most, and why.
    capture : Capture or None
        The newest cycle; None where there is none yet.
    faults : tuple of str
        What is wrong with it; each names cell, cycle and register.
    """

    identity: Mapping[str, Value]
    identification: Mapping[str, str]
    status: StatusBlock
    round_trip_s: float
    window: str
    capture: Capture | None
    faults: tuple[str, ...]


async def probe(module: ModuleAcquisition) -> ProbeResult:
    """Connect to a module and read its identity, its status block and its newest cycle.

    Raises
    ------
    FieldbusError
        It does not answer, is another module, or has the other word order.
    """
    async with module:
        status = await module.connect_once()
        try:
            await module.find_window()
        except LinkError:
            await module.close()
            status = await module.connect_once()
        identity = (await module.register_client.read_image(IDENTITY)).values
        status, capture, faults = await _newest(module, status)
        round_trip_s = module.status.round_trip_s
        window = str(module.register_client.modbus.window)
        identification = await _identification(module)
        return ProbeResult(identity, identification, status, round_trip_s, window, capture, faults)


async def _identification(module: ModuleAcquisition) -> Mapping[str, str]:
    """Ask last, for a device that does not know the function may not answer at all."""
    try:
        return await module.register_client.modbus.identification()
    except FieldbusError:
        return {}


async def _newest(
    module: ModuleAcquisition, status: StatusBlock
) -> tuple[StatusBlock, Capture | None, tuple[str, ...]]:
    """Read the newest cycle, or the next that takes its place meanwhile; with the status that has it."""
    reader = CaptureReader(module.cell, module.register_client)
    taken = TakenCycles(None, 0, module.registers.slots, reader.numbers)
    for looks in itertools.count(1):
        counter = status.cycle_counter
        if not counter:
            break
        if counter not in status.ring:
            return status, None, (_not_in_the_ring(module, status),)
        cycle_id = CycleId(status.session, counter)
        target = NextCapture(cycle_id, status.ring.index(counter), counter, missed=0, restarted=False)
        fetched = await reader.fetch(target, taken)
        if not isinstance(fetched, NotFetched):
            return status, fetched.capture if fetched.readable else None, fetched.faults
        if fetched is not NotFetched.OVERWRITTEN or looks == MOST_LOOKS:
            return status, None, (f"{module.cell}: cycle {counter}: {fetched.value}",)
        status = await module.read_status()
    return status, None, ()


def _not_in_the_ring(module: ModuleAcquisition, status: StatusBlock) -> str:
    held = ", ".join(str(cycle) for cycle in status.ring[:4])
    what = f"cycle_counter shows {status.cycle_counter}, but ring_cycle {held} ..."
    way_out = f"one of them has another address, type or word order than in map {module.registers.name}"
    return f"{module.cell}: {what}: {way_out}"
