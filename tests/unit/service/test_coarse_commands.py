"""A positioning task whose module is commanded by whole numbers plans, makes and learns from those taps."""

from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.fieldbus.cycles.status_block import PositioningStatus
from impactcell.fieldbus.tap_commands import Objection, TapCommand
from impactcell.positioning import Tap
from impactcell.service.factory import cell_design, positioning_cell, tap_planner
from impactcell.service.positioning import PositioningTask
from impactcell.settings import CellConfig
from impactcell.settings.commanded_taps import doubted_commands
from tests.told_module import ToldModule, block, task_of, worker_of


@pytest.fixture
def coarse(cell: CellConfig) -> CellConfig:
    """Give the cell steps of 1 mm/s and 0.1 mm, and limits between them: 99.6 mm/s and 1.46 mm."""
    registers = cell.register_map
    moved = {
        "command_velocity": replace(registers["command_velocity"], kind="u16", unit="mm/s"),
        "command_stroke": replace(registers["command_stroke"], kind="u16", scale=0.1),
    }
    limits = {"max_velocity_mm_per_min": 5976.0, "max_stroke_mm": 1.46}
    actuator = cell.settings.actuator.model_copy(update=limits)
    return replace(
        cell,
        register_map=replace(registers, registers={**registers.registers, **moved}),
        settings=cell.settings.model_copy(update={"actuator": actuator}),
    )


class Recorder:
    """Takes each tap as a module would that is commanded by whole numbers, and moves the part as foretold."""

    def __init__(self, module: ToldModule, task: PositioningTask, registers: CellConfig) -> None:
        self.module, self.task, self.registers = module, task, registers.register_map
        self.taps: list[tuple[float, float]] = []
        self.position_m = 0.0
        task._positioner = self  # type: ignore[assignment]

    async def tap(self, command: TapCommand, _objection: Objection) -> PositioningStatus:
        shown = {
            name: float(self.registers[name].decode(self.registers[name].encode(value)))  # type: ignore[arg-type]
            for name, value in command.parameters.items()
        }
        assert shown == pytest.approx(command.parameters, rel=1e-9)
        self.taps.append((shown["command_velocity"], shown["command_stroke"]))
        planned = self.task._sequence.tap
        assert planned is not None
        assert (planned.velocity_m_s, planned.stroke_m) == pytest.approx(self.taps[-1], rel=1e-9)
        self.position_m += planned.expected_m
        self.module.shown = block(position_m=self.position_m)
        assert self.module.shown.positioning is not None
        return self.module.shown.positioning


@pytest.mark.slow
async def test_no_tap_passes_a_limit_because_its_register_rounds(tmp_path: Path, coarse: CellConfig) -> None:
    """0.0996 m/s and 1.46 mm were struck with 0.1 m/s and 1.5 mm, and learned from as planned."""
    module, worker = ToldModule.of(coarse), worker_of(coarse, tmp_path / "j")
    task = task_of(coarse, module, worker)
    recorder = Recorder(module, task, coarse)
    await module.read_status()
    await task.begin(0.03)
    await task._drive()
    assert task.fault is None, task.fault
    assert recorder.taps
    assert max(velocity for velocity, _ in recorder.taps) <= 0.0996
    assert max(stroke for _, stroke in recorder.taps) <= 1.46e-3
    await worker.close()


async def test_a_reload_plans_for_the_map_that_the_module_is_read_with(
    tmp_path: Path, cell: CellConfig, coarse: CellConfig
) -> None:
    """Another register map needs a restart: until then taps are commanded through the one before."""
    module, worker = ToldModule.of(coarse), worker_of(coarse, tmp_path / "j")
    task = task_of(coarse, module, worker)
    await module.read_status()
    await task.redesign(cell, cell_design(cell))
    await task.begin(0.03)
    velocity, stroke = task.state.next_velocity_m_s * 1e3, task.state.next_stroke_m * 1e4
    assert (velocity, stroke) == (pytest.approx(round(velocity)), pytest.approx(round(stroke)))
    await worker.close()


@pytest.mark.parametrize(
    ("limits", "offset"),
    [({"max_velocity_mm_per_min": 30.0}, 0.0), ({"max_stroke_mm": 0.05}, 0.0), ({}, -1e6)],
)
def test_a_cell_whose_registers_command_no_tap_runs_and_none_is_commanded(
    coarse: CellConfig, limits: dict[str, float], offset: float
) -> None:
    """Its friction is told all the same; `impactcell check` names the register."""
    registers = coarse.register_map
    stroke = replace(registers["command_stroke"], offset=offset)
    registers = replace(registers, registers={**registers.registers, "command_stroke": stroke})
    actuator = coarse.settings.actuator.model_copy(update=limits)
    cell = replace(
        coarse, register_map=registers, settings=coarse.settings.model_copy(update={"actuator": actuator})
    )
    assert any(is_fault and "no tap can be commanded" in told for _, told, is_fault in doubted_commands(cell))
    planner = tap_planner(cell, positioning_cell(cell), cell_design(cell), registers)
    tap = planner.next_tap(0.03, 18.9)
    if isinstance(tap, Tap):
        command = TapCommand(tap.velocity_m_s, tap.stroke_m, tap.direction)
        shown = [
            float(registers[name].decode(registers[name].encode(value)))  # type: ignore[arg-type]
            for name, value in command.parameters.items()
        ]
        assert shown != pytest.approx(list(command.parameters.values()), rel=1e-6)
