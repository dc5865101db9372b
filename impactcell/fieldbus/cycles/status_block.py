"""Words of the module's status block become a `StatusBlock`. Pure, never fails."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from impactcell.fieldbus.register_map.map_registers import SHOWN
from impactcell.fieldbus.registers import Register, RegisterMap, Value
from impactcell.records import BatchAnnouncement

UNREADABLE: Final = -1
"""Cycle of a slot of the ring that shows no number: a decimal code with a digit above 9."""


@dataclass(frozen=True, slots=True)
class PositioningStatus:
    """What the module says of positioning; see the map for the codes.

    Attributes
    ----------
    state, result : str
        Names of the codes of `positioning_state` and `command_result`.
    position_m, target_m : float
        Where the part lies, and where the PLC wants it.
    target_sequence : int
        Raised by the PLC with each new target.
    mass_kg : float
        nan where the PLC does not know it.
    accepted_command : int
        Sequence number of the last command that the module looked at.
    cycle : int
        Cycle made by that command, 0 for none.
    """

    state: str
    result: str
    position_m: float
    target_m: float
    target_sequence: int
    mass_kg: float
    accepted_command: int
    cycle: int


@dataclass(frozen=True, slots=True)
class StatusBlock:
    """The status block of one poll.

    The ring of a module with one buffer is its last cycle; a slot that shows no number is `UNREADABLE`.
    """

    state: str
    session: int
    cycle_counter: int
    ring: tuple[int, ...]
    batch: BatchAnnouncement | None
    positioning: PositioningStatus | None


STATUS_REGISTERS = (
    "state", "session", "cycle_counter", "ring_cycle",
    "batch_sequence", "batch_from_cycle", "batch_announced",
    *SHOWN, "status_crc32",
)  # fmt: skip
"""Registers of a poll, where the map has them."""

_BATCH = ("batch_sequence", "batch_from_cycle", "batch_announced")


def _code_name(register: Register, value: Value) -> str:
    code = int(value) if isinstance(value, int | float) else -1
    return register.codes.get(code, f"unknown ({code})")


def integer(value: Value) -> int:
    """Give a value that is an integer; 0 for any other."""
    return value if isinstance(value, int) else 0


def number(value: Value) -> float:
    """Give a value that is a number; nan for any other."""
    return float(value) if isinstance(value, int | float) else math.nan


def decode_status(registers: RegisterMap, values: Mapping[str, Value]) -> StatusBlock:
    """Put the decoded registers of `STATUS_REGISTERS` together."""
    batch = positioning = None
    if all(name in values for name in _BATCH):
        batch = BatchAnnouncement(
            integer(values["batch_sequence"]),
            integer(values["batch_from_cycle"]),
            str(values["batch_announced"]),
        )
    if all(name in values for name in SHOWN):
        positioning = PositioningStatus(
            state=_code_name(registers["positioning_state"], values["positioning_state"]),
            result=_code_name(registers["command_result"], values["command_result"]),
            position_m=number(values["part_position"]),
            target_m=number(values["target_position"]),
            target_sequence=integer(values["target_sequence"]),
            mass_kg=number(values["part_mass"]),
            accepted_command=integer(values["command_accepted"]),
            cycle=integer(values["command_cycle"]),
        )
    ring = np.atleast_1d(np.asarray(values.get("ring_cycle", values["cycle_counter"]), dtype=np.float64))
    return StatusBlock(
        state=_code_name(registers["state"], values["state"]) if "state" in values else "not told",
        session=integer(values.get("session", 0)),
        cycle_counter=integer(values["cycle_counter"]),
        ring=tuple(UNREADABLE if math.isnan(cycle) else int(cycle) for cycle in ring),
        batch=batch,
        positioning=positioning,
    )
