"""Positioning commands as the module takes them from its registers. Pure."""

import enum
from typing import Final

from simulator.image import RegisterImage
from simulator.plant import TapInput
from simulator.scenario import Positioning
from simulator.scenario_file import MM_PER_MIN
from simulator.tasks import PartSequence

SINGLE_PRECISION: Final = 1.0 + 1e-6
"""The registers are single precision: a limit itself must not be refused for its last bit."""

LEAST_VELOCITY_M_S: Final = 1e-6
"""Slowest movement of the actuator [m/s]; a slower command is refused. An assumption of the simulator's."""


class ModuleState(enum.IntEnum):
    """Codes of the register `state`."""

    STARTING = 0
    READY = 1
    CYCLE_RUNNING = 2
    BUSY = 3
    FAULT = 4


class PositioningState(enum.IntEnum):
    """Codes of the register `positioning_state`."""

    NONE = 0
    READY = 1
    EXECUTING = 2
    FAULT = 3


class CommandResult(enum.IntEnum):
    """Codes of the register `command_result`."""

    NONE = 0
    EXECUTING = 1
    DONE = 2
    REFUSED_VALUE = 3
    REFUSED_STATE = 4
    ABORTED = 5
    FAULT = 6


def commanded(image: RegisterImage, positioning: Positioning, parts: PartSequence) -> TapInput | None:
    """Return the tap that the registers ask for; None where the actuator cannot do it."""
    velocity, stroke = float(image.get("command_velocity")), float(image.get("command_stroke"))
    direction = int(image.get("command_direction"))
    most_velocity = positioning.most_velocity_mm_per_min * MM_PER_MIN * SINGLE_PRECISION
    most_stroke = positioning.most_stroke_m * SINGLE_PRECISION
    if not (LEAST_VELOCITY_M_S <= velocity <= most_velocity and 0.0 < stroke <= most_stroke):
        return None
    if direction not in positioning.directions:
        return None
    return TapInput(velocity, parts.part.mass_kg, stroke, direction, start_m=parts.position_m)


def show_result(image: RegisterImage, sequence: int, result: CommandResult) -> None:
    """Show what became, or is becoming, of a command."""
    image.put("command_accepted", sequence)
    image.put("command_result", result)


def show_part(image: RegisterImage, parts: PartSequence, *, mass_stated: bool) -> None:
    """Show where the part lies, and the PLC's target for it where it is a new one."""
    image.put("part_position", parts.position_m)
    image.put("part_mass", parts.part.mass_kg if mass_stated else float("nan"))
    if parts.number > int(image.get("target_sequence")):
        image.put("target_position", parts.part.target_m)
        image.put("target_sequence", parts.number)
