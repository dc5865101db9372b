"""One look at a live module: who it is, what it says, and one tap of it; nothing is acknowledged."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from impactcell.errors import FieldbusError, LinkError
from impactcell.fieldbus.acquisition import ModuleAcquisition
from impactcell.fieldbus.capture_reader import CaptureReader
from impactcell.fieldbus.capture_ring import NextCapture
from impactcell.fieldbus.fetched_capture import NotFetched
from impactcell.fieldbus.registers import Value
from impactcell.fieldbus.status_block import StatusBlock
from impactcell.fieldbus.taken_cycles import TakenCycles
from impactcell.records import Capture, CycleId

IDENTITY: Final = ("module_name", "serial_number", "map_version", "firmware_version")
"""Registers that say who the module is, where the map has them."""


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
        capture: Capture | None = None
        faults: tuple[str, ...] = ()
        if status.cycle_counter in status.ring and status.cycle_counter:
            capture, faults = await _newest(module, status)
        elif status.cycle_counter:
            held = ", ".join(str(cycle) for cycle in status.ring[:4])
            what = f"cycle_counter shows {status.cycle_counter}, but ring_cycle {held} ..."
            way_out = (
                f"one of them has another address, type or word order than in map {module.registers.name}"
            )
            faults = (f"{module.cell}: {what}: {way_out}",)
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


async def _newest(module: ModuleAcquisition, status: StatusBlock) -> tuple[Capture | None, tuple[str, ...]]:
    counter = status.cycle_counter
    cycle_id = CycleId(status.session, counter)
    target = NextCapture(cycle_id, status.ring.index(counter), counter, missed=0, restarted=False)
    reader = CaptureReader(module.cell, module.register_client)
    fetched = await reader.fetch(target, TakenCycles(None, 0, module.registers.slots, reader.numbers))
    if isinstance(fetched, NotFetched):
        return None, (f"{module.cell}: cycle {counter}: {fetched.value}",)
    return fetched.capture if fetched.readable else None, fetched.faults
