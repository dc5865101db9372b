"""What the positioning tasks of a running cell plan with: limits, mass, friction and model of now."""

import math

from impactcell.cell import CellDesign
from impactcell.fieldbus.cycles.status_block import PositioningStatus
from impactcell.fieldbus.registers import RegisterMap
from impactcell.positioning import task_state_machine
from impactcell.positioning.task_state_machine import TaskState
from impactcell.records import Snapshot
from impactcell.service.factory import positioning_cell, tap_planner
from impactcell.service.known_friction import is_friction_known, kinetic_friction
from impactcell.settings import CellConfig

SAME_PLACE = 0.5
"""Share of the tolerance by which two readings of where a part lies at rest may differ.

A tap aims at the target, and misses it by so much more; an encoder whose readings scatter by more could not
tell whether a part is in place.
"""
SAME_PLACE_STEPS = 2.0
"""Steps of the encoder by which they may differ at least: one that lies between two shows either."""


class CellPlanner:
    """Takes a task from one state to the next; but for the attributes, in the worker's thread.

    Attributes
    ----------
    limits : PositioningCell
    taps : TapPlanner
    """

    def __init__(
        self, cell: CellConfig, design: CellDesign, registers: RegisterMap, snapshot: Snapshot | None
    ) -> None:
        self.limits = positioning_cell(cell)
        self.taps = tap_planner(cell, self.limits, design, registers)
        self._design = design
        self._registers = registers
        self._batch_shift_cycle = snapshot.batch.last_shift_cycle if snapshot else 0

    def begin(
        self, before: TaskState, target_m: float, report: PositioningStatus, snapshot: Snapshot | None
    ) -> TaskState:
        """Start a task from where the module reports the part; raises as `begin_task`."""
        mass_kg = report.mass_kg
        if math.isnan(mass_kg) and self._design.defaults.mass_kg is not None:
            mass_kg = self._design.defaults.mass_kg
        return task_state_machine.begin_task(
            before,
            self.limits,
            self.taps,
            target_m=target_m,
            position_m=report.position_m,
            mass_kg=mass_kg,
            trained=is_friction_known(snapshot, self._design),
        )

    def is_planned_from(self, task: TaskState, position_m: float) -> bool:
        """Whether a part at `position_m` lies where the tap of a task was planned from; from any thread."""
        same_m = max(SAME_PLACE_STEPS * self.limits.resolution_m, SAME_PLACE * self.taps.tolerance_m)
        return abs(position_m - task.position_m) <= same_m

    def replan(self, task: TaskState, position_m: float) -> TaskState:
        """Go on where the part lies elsewhere than its tap was planned from; nothing was commanded."""
        return task_state_machine.replan(task, self.limits, self.taps, position_m)

    def observe(self, task: TaskState, position_m: float) -> TaskState:
        """Go on after a tap, and learn from it."""
        return task_state_machine.observed(task, self.limits, self.taps, position_m)

    def redesign(self, cell: CellConfig, design: CellDesign) -> bool:
        """Go on with other limits or another model; say whether it is another model.

        What has been learned of the contact stays. What the model lacked is not told again; taps to come have
        to show whether the new one lacks any.
        """
        limits = positioning_cell(cell)
        if limits != self.limits:
            taps = tap_planner(cell, limits, design, self._registers)
            taps.resume(self.taps.posterior)
            self.limits, self.taps = limits, taps
        another_plant = design.model.plant != self._design.model.plant
        if another_plant:
            self.taps.accept_model()
        self._design = design
        return another_plant

    def update_friction(self, snapshot: Snapshot) -> None:
        """Take over the friction that the tracker believes in."""
        friction = kinetic_friction(snapshot, self._design)
        if friction is not None:
            shift_cycle = snapshot.batch.last_shift_cycle
            shifted = shift_cycle not in (0, self._batch_shift_cycle)
            self._batch_shift_cycle = shift_cycle
            self.taps.observe_friction(*friction, batch_changed=shifted)
