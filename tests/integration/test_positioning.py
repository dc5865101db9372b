"""Parts brought to their targets by the running service, against the simulator's own plant."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from impactcell.errors import PositioningError, SettingsError
from impactcell.journal.audit_entries import AuditEntry
from impactcell.settings import read_cell
from tests.integration.processes import simulator, told, write_cell
from tests.integration.watched import Watched, serving
from tests.patience import COMPILING_S

pytestmark = pytest.mark.slow

TASKS = [
    {"target_m": 0.008, "mass_kg": 12.0},
    {"target_m": 0.015, "mass_kg": 30.0},
    {"target_m": 0.005, "mass_kg": 20.0},
]
AUDIT = AuditEntry(1, "eve", "SetTarget", "", "Good")
CELL: dict[str, Any] = {
    "positioning": {"tolerance_um": 50.0, "travel_mm": 40.0},
    "actuator": {"stroke_mm": None, "max_stroke_mm": 1.5, "both_ends": True},
}


def scenario(tasks: list[dict[str, float]]) -> dict[str, Any]:
    return {"base": "positioning", "acceleration": 8, "positioning": {"tasks": tasks, "pause_s": 0.1}}


async def outcomes(truth: Path, count: int) -> list[dict[str, Any]]:
    """Wait until so many tasks have ended in the simulator."""
    async with asyncio.timeout(COMPILING_S):
        while True:
            ended = [entry for entry in told(truth) if "inside" in entry]
            if len(ended) >= count:
                return ended
            await asyncio.sleep(0.1)


async def test_parts_end_inside_their_tolerance(tmp_path: Path) -> None:
    async with simulator(tmp_path, **scenario(TASKS)) as module:
        async with serving(write_cell(tmp_path, module["port"], **CELL)):
            ended = await outcomes(module["truth"], len(TASKS))
    assert [entry["inside"] for entry in ended] == [True] * len(TASKS)
    assert all(abs(entry["position_m"] - entry["target_m"]) <= 5e-5 for entry in ended)


async def refused(watched: Watched, target_m: float) -> str:
    with pytest.raises(PositioningError) as caught:
        await watched.service.running["press-1"].set_target(target_m, AUDIT)
    return str(caught.value)


async def test_what_is_refused_commands_nothing(tmp_path: Path) -> None:
    one_sided = {**CELL, "actuator": {**CELL["actuator"], "both_ends": False}}
    async with simulator(tmp_path, **scenario([])) as module:
        async with serving(write_cell(tmp_path, module["port"], **one_sided)) as watched:
            await watched.alarm("press-1", "ModuleConnection", active=False)
            await watched.connected("press-1")
            assert "beyond the travel" in await refused(watched, 0.5)
            assert "beyond the travel" in await refused(watched, -0.001)
            assert "position in mm" in await refused(watched, float("nan"))
        fine = {**CELL, "positioning": {"tolerance_um": 0.5, "travel_mm": 40.0}}
        with pytest.raises(SettingsError, match=r"finer than encoder_resolution_um 1: raise it"):
            read_cell(write_cell(tmp_path, module["port"], **fine))
        plain = {"positioning": None, "actuator": {"stroke_mm": None}}
        async with serving(write_cell(tmp_path, module["port"], **plain)) as watched:
            assert "has no positioning" in await refused(watched, 0.005)
    assert told(module["truth"]) == []


async def test_a_person_sets_a_target_and_aborts(tmp_path: Path) -> None:
    async with simulator(tmp_path, **scenario([])) as module:
        async with serving(write_cell(tmp_path, module["port"], **CELL)) as watched:
            cell = watched.service.running["press-1"]
            await watched.connected("press-1")
            await cell.set_target(0.03, AUDIT)
            assert "is running; abort it first" in await refused(watched, 0.02)
            await watched.until("press-1", 1)
            await cell.abort_positioning(AUDIT)
            struck = len(told(module["truth"]))
            await cell.abort_positioning(AUDIT)
            with pytest.raises(TimeoutError):
                await watched.until("press-1", struck + 2, timeout_s=2.0)
            await cell.set_target(0.03, AUDIT)
            await watched.until("press-1", struck + 1)


async def test_a_lost_link_stops_the_sequence_with_an_alarm(tmp_path: Path) -> None:
    async with simulator(tmp_path, **scenario([])) as module:
        async with serving(write_cell(tmp_path, module["port"], **CELL)) as watched:
            cell = watched.service.running["press-1"]
            await watched.connected("press-1")
            await cell.set_target(0.03, AUDIT)
            await watched.until("press-1", 1)
            module["running"].process.kill()
            message = await watched.alarm("press-1", "PositioningFault", active=True)
            assert "press-1" in message
