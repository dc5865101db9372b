"""What a scenario asks for that a module with its register map cannot do or show. Pure."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from impactcell.errors import MapError
from impactcell.fieldbus.registers import RegisterMap
from simulator.scenario import Scenario

Location = tuple[str | int, ...]

_SPOILS_FORCE = ("constant_force", "saturated", "no_separation", "not_a_number")
"""Faulty captures that are made of the force."""

_PLACING = {
    "positioning_state": {"ready", "executing"},
    "command_result": {"executing", "done"},
}
"""Names of codes without which nobody sees what becomes of a command."""


@dataclass(frozen=True, slots=True)
class MapFault:
    """Something of a scenario that does not go with its map, and where it stands in the scenario."""

    location: Location
    message: str


def map_faults(scenario: Scenario, registers: RegisterMap) -> Iterator[MapFault]:
    """Say what a scenario asks for that a module with these registers cannot do or show."""
    if scenario.strikes and scenario.strikes.ahead and "acknowledge_cycle" not in registers:
        message = "`strikes.ahead` waits until cycles are acknowledged, and the register map has no "
        message += "`acknowledge_cycle`: leave `ahead` out, or give the map that register"
        yield MapFault(("strikes", "ahead"), message)
    for place, entry in enumerate(scenario.faulty_captures):
        if entry.kind in _SPOILS_FORCE and "force" not in registers:
            message = f"`faulty_captures[{place}]` ({entry.kind}) is one of the force, and the register map "
            message += "has no `force`: leave it out, or give the map that register"
            yield MapFault(("faulty_captures", place, "kind"), message)
    if scenario.positioning is not None:
        for name, words in _PLACING.items():
            missing = sorted(words - set(registers[name].codes.values())) if name in registers else []
            if missing:
                message = f"`positioning` cannot be shown: register {name} has no code named "
                message += f"{' or '.join(map(repr, missing))}; name it under its `codes` in the register map"
                yield MapFault(("positioning",), message)
    for location, name, value in _shown(scenario):
        fault = _fault_of(registers, name, value)
        if fault:
            key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
            message = f"`{key.removeprefix('.')}` cannot be shown: {fault}; change it, or the register map"
            yield MapFault(location, message)


def _shown(scenario: Scenario) -> Iterator[tuple[Location, str, str | int | float]]:
    """Give what stands where in a scenario, the register that shows it, and the value that has to fit."""
    yield ("serial_number",), "serial_number", scenario.serial_number
    for place, batch in enumerate(scenario.batches):
        if batch.announced:
            yield ("batches", place, "id"), "batch_id", batch.id
            yield ("batches", place, "id"), "batch_announced", batch.id
    for place, fault in enumerate(scenario.faults):
        if fault.value is not None:
            yield ("faults", place, "value"), "cycle_counter", fault.value
    if not scenario.part.mass_stated:
        yield ("part", "mass_stated"), "mass", math.nan
        yield ("part", "mass_stated"), "part_mass", math.nan
    for place, capture in enumerate(scenario.faulty_captures):
        if capture.kind == "not_a_number":
            yield ("faulty_captures", place, "kind"), "force", math.nan
    for section in ("strikes", "positioning"):
        moves = getattr(scenario, section)
        if moves is not None and -1 in moves.directions:
            yield (section, "directions"), "direction", -1


def _fault_of(registers: RegisterMap, name: str, value: str | float) -> str:
    """Say why a register cannot show a value; empty where it can, and where there is no such register."""
    if name not in registers:
        return ""
    try:
        registers[name].encode(value)
    except MapError as error:
        return str(error)
    except ValueError:
        return f"register {name} is a number, not {value!r}"
    return ""
