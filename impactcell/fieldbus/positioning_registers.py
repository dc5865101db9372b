"""What a register map has to have, and to call by name, for the module of a cell that places parts."""

import math
from collections.abc import Iterator
from typing import Final

from impactcell.fieldbus.register_map.map_registers import SHOWN
from impactcell.fieldbus.register_map.register_types import code_range
from impactcell.fieldbus.registers import RegisterMap
from impactcell.numerics.raster import ANY_VALUE, NEARLY_EQUAL, Raster

PARAMETERS: Final = ("command_velocity", "command_stroke", "command_direction")
"""Registers that a tap is written to; then `command_sequence` has it made."""
COMMAND: Final = (*PARAMETERS, "command_sequence")
_NUMBERED: Final = ("command_sequence", "command_accepted")
"""Registers that show the number of a command."""
_MOST_COMMANDS: Final = 2**32 - 1
"""Number of a command, at most; a wider register shows no larger one."""
READY: Final = "ready"
"""Code of `positioning_state` of a module that takes a command."""
EXECUTING, DONE = "executing", "done"
"""Codes of `command_result`; every other name is a refusal, and is told."""
_CODES: Final = {"positioning_state": (READY,), "command_result": (EXECUTING, DONE)}


def not_placing(registers: RegisterMap) -> Iterator[str]:
    """Say why a module of this map can place no part, a sentence each."""
    missing = [name for name in (*SHOWN, *COMMAND) if name not in registers]
    if missing:
        yield f"no register{'s' if len(missing) > 1 else ''} {', '.join(missing)}: no part can be placed"
    for name, wanted in _CODES.items():
        codes = registers[name].codes if name in registers else dict(enumerate(wanted))
        for word in wanted:
            if word not in codes.values():
                yield f"no code of register {name} is called `{word}`: every tap would be refused"
    if not missing and "command_abort" not in registers:
        yield "no register command_abort: a tap that is executed cannot be aborted"


def commanded_values(registers: RegisterMap, name: str) -> Raster:
    """Return the values above 0 that can be commanded through a register, SI: any through one of floats.

    Raises
    ------
    RasterError
        No code of it stands for a value above 0.
    """
    register = registers.registers.get(name)
    codes = None if register is None else register.saturation or code_range(register.kind)
    if register is None or codes is None:
        return ANY_VALUE
    least, most = codes
    first = max(least, math.floor(NEARLY_EQUAL - register.offset / register.scale) + 1)
    at_zero, step = register.si_offset, register.si_factor
    return Raster(step, at_zero + first * step, at_zero + most * step)


def last_sequence(registers: RegisterMap) -> int:
    """Return the largest number of a command that the registers of a positioning cell show; then comes 1."""
    ranges = (code_range(registers[name].kind) for name in _NUMBERED if name in registers)
    return min((_MOST_COMMANDS, *(most for _, most in filter(None, ranges))))


def is_ahead(number: int, accepted: int, last: int) -> bool:
    """Whether a command comes after the last one that was taken, by serial arithmetic (RFC 1982).

    Numbers run from 1 to `last` and begin anew with 1; what is up to half of them further on is ahead, the
    rest behind. Where none was taken yet, 0, every number is ahead.

    >>> is_ahead(1, 9999, 9999), is_ahead(9999, 1, 9999), is_ahead(7, 0, 9999)
    (True, False, True)
    """
    return number != 0 and (accepted == 0 or 0 < (number - accepted) % last <= last // 2)


def next_sequence(accepted: int, written: int, last: int) -> int:
    """Return the number of the next command: after the last one taken, or one that was written after that.

    >>> next_sequence(4, 0, 9999), next_sequence(4, 5, 9999), next_sequence(4, 2, 9999)
    (5, 6, 5)
    """
    after = written % last + 1
    return after if written and is_ahead(after, accepted, last) else accepted % last + 1
