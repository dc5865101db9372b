"""Positioning commands as the module takes them from its registers. Pure."""

import enum
from typing import Final

from simulator.image import RegisterImage
from simulator.plant import TapInput
from simulator.scenario import Positioning, Scenario
from simulator.scenario_file import MM_PER_MIN
from simulator.tasks import PartSequence

SINGLE_PRECISION: Final = 1.0 + 1e-6
"""The registers are single precision: a limit itself must not be refused for its last bit."""

LEAST_VELOCITY_M_S: Final = 1e-6
"""Slowest movement of the actuator [m/s]; a slower command is refused. An assumption of the simulator's."""


class ModuleState(enum.Enum):
    """What the register `state` shows: names of its codes, the first that a map has."""

    READY = ("ready",)
    CYCLE_RUNNING = ("cycle running", "busy", "not ready")
    FAULT = ("fault", "not ready")


class PositioningState(enum.Enum):
    """What the register `positioning_state` shows."""

    NONE = ("none",)
    READY = ("ready",)
    EXECUTING = ("executing",)
    FAULT = ("fault",)


class CommandResult(enum.Enum):
    """What the register `command_result` shows."""

    EXECUTING = ("executing",)
    DONE = ("done",)
    REFUSED_VALUE = ("refused value",)
    REFUSED_STATE = ("refused state",)
    ABORTED = ("aborted",)
    FAULT = ("fault",)


_MEANWHILE: Final = {
    CommandResult.EXECUTING: PositioningState.EXECUTING,
    CommandResult.FAULT: PositioningState.FAULT,
}
"""State in which the module is with a result; it is ready with the others."""


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
    if result in _MEANWHILE:
        image.put_code("positioning_state", _MEANWHILE[result].value)
    image.put("command_accepted", sequence)
    image.put_code("command_result", result.value)


def show_ready(image: RegisterImage, scenario: Scenario) -> None:
    """Show that the module takes commands, if it ever does."""
    shown = PositioningState.NONE if scenario.positioning is None else PositioningState.READY
    image.put_code("positioning_state", shown.value)


def show_part(image: RegisterImage, parts: PartSequence, *, mass_stated: bool) -> None:
    """Show where the part lies, and the PLC's target for it where it is a new one."""
    image.put("part_position", parts.position_m)
    image.put("part_mass", parts.part.mass_kg if mass_stated else float("nan"))
    if parts.number > int(image.get("target_sequence")):
        image.put("target_position", parts.part.target_m)
        image.put("target_sequence", parts.number)
