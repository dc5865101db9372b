"""One cycle of a cell as a whole: what its parts are told of each other."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from impactcell import cell as core
from impactcell.cell import CellDesign
from impactcell.records import Channel, PositioningState, Quality
from impactcell.service.factory import cell_design
from impactcell.settings import read_cell
from tests.integration.processes import CONFIG
from tests.taps import VISCOUS, Tap

pytestmark = pytest.mark.slow

STRIBECK: dict[str, Any] = {
    "stribeck_friction": {"friction_increase": 0.03, "stribeck_velocity_m_s": 0.04},
}


def deviant_cycles(design: CellDesign, seed: int, cycles: int) -> list[int]:
    """Friction rises towards standstill from cycle 26 on, at velocities that vary, in both directions.

    Taps of the faster velocities slide beyond the grid, where nothing is learned of friction.
    """
    state, draw, deviant = core.initial_state(design), np.random.default_rng(seed), []
    for cycle in range(1, cycles + 1):
        tap = Tap(
            float(draw.choice([2000, 3000, 4000, 5000, 6000])) / 6e4,
            0.2 * (1.0 + 0.012 * draw.standard_normal()),
            stroke_m=1.5e-3,
            direction=int(draw.choice([1, -1])),
            effects=VISCOUS | STRIBECK if cycle > 25 else VISCOUS,
        )
        stepped = core.step(design, state, tap.capture(draw, cycle=cycle), PositioningState(), None, ())
        state = stepped.state
        if np.isfinite(stepped.snapshot.signature.deviates_at_m):
            deviant.append(cycle)
    return deviant


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_an_effect_that_the_model_knows_makes_no_cycle_deviant(seed: int) -> None:
    design = cell_design(read_cell(CONFIG / "cells" / "new-effect.yaml"))
    plant = replace(design.model.plant, effects=VISCOUS | STRIBECK)
    design = replace(design, model=replace(design.model, plant=plant))
    assert deviant_cycles(design, seed, 90) == []


def test_a_deviant_cycle_says_where_from_the_end_of_contact_and_from_where_the_part_lay() -> None:
    """A bump lies on the table, 2 mm from the part, in the slide of cycle 71."""
    design = cell_design(read_cell(CONFIG / "cells" / "new-effect.yaml"))
    state, draw = core.initial_state(design), np.random.default_rng(5)
    bump = {"friction_patch": {"amplitude": 0.5, "position_m": -0.002, "width_m": 0.0005}}
    for cycle in range(1, 78):
        effects = VISCOUS | (bump if cycle == 71 else {})
        mu_s = 0.2 * (1.0 + 0.006 * draw.standard_normal())
        tap = Tap(4000 / 6e4, mu_s, stroke_m=1.5e-3, direction=-1, effects=effects)
        stepped = core.step(design, state, tap.capture(draw, cycle=cycle), PositioningState())
        state = stepped.state
    alarm = state.alarms.alarm("DeviantCycle")
    assert alarm.active
    pushed_mm = 1e3 * abs(float(tap.motion().position_m(np.array([tap.motion().separation_s]))[0]))
    for message, words in (
        (alarm.message, r"(.*) mm after contact ended \((.*) mm from where the part lay\)"),
        (alarm.message_de, r"(.*) mm nach Ende des Kontakts \((.*) mm von dort. wo das Teil lag\)"),
    ):
        found = re.search(r": " + words, message.replace(",", "."))
        assert found is not None, message
        slid_mm, way_mm = map(float, found.groups())
        assert way_mm == pytest.approx(2.0, abs=0.2)
        assert way_mm - slid_mm == pytest.approx(pushed_mm, abs=0.02)


@pytest.mark.long
def test_an_effect_of_every_cycle_is_soon_how_cycles_vary() -> None:
    """The model has not taken it over: slow cycles deviate, others between them do not; 0 to 7 of 135."""
    design = cell_design(read_cell(CONFIG / "cells" / "new-effect.yaml"))
    found = [deviant_cycles(design, seed, 160) for seed in (1, 2, 5)]
    assert 4 < sum(map(len, found)) < 45
    assert max(cycle for of_seed in found for cycle in of_seed) < 120


def test_contact_between_two_samples_of_a_module_bends_no_friction() -> None:
    """At 100 kHz it lies up to 10 µs before t = 0: mu_s of light parts was 15 standard deviations off."""
    design = cell_design(read_cell(CONFIG / "cells" / "new-effect.yaml"))
    draw, state, pulls = np.random.default_rng(3), core.initial_state(design), []
    for cycle in range(1, 25):
        mu_s, late_s = float(draw.uniform(0.15, 0.25)), 1e-5 * draw.uniform()

        def counted(channel: Channel | None, late_s: float = late_s) -> Channel:
            assert channel is not None
            kept = channel.time_s > late_s
            return replace(channel, time_s=channel.time_s[kept] - late_s, values=channel.values[kept])

        mass_kg = float(draw.choice([8.0, 12.6, 25.2]))
        tap = Tap(float(draw.uniform(0.035, 0.09)), mu_s, mass_kg=mass_kg, stroke_m=1.5e-3)
        seen = tap.capture(draw, force_hz=1e5, cycle=cycle)
        seen = replace(seen, force=counted(seen.force), position=counted(seen.position))
        stepped = core.step(design, state, seen, PositioningState(), None, ())
        state, found = stepped.state, stepped.snapshot.friction.mu_s
        if found.quality is Quality.GOOD:
            pulls.append((found.value - mu_s) / found.std)
    assert len(pulls) > 12
    assert float(np.abs(pulls).max()) < 4.0


def test_a_level_of_a_wrong_model_is_known_no_better_than_what_its_taps_share() -> None:
    """mu_k/mu_s is 3 % below the model's: the average of 60 taps is off by far more than it scatters."""
    design = cell_design(read_cell(CONFIG / "cells" / "prototype.yaml"))
    state, draw = core.initial_state(design), np.random.default_rng(4)
    for cycle in range(1, 61):
        tap = Tap(0.05, 0.2, ratio=0.97 * design.model.ratio, stroke_m=1.5e-3)
        stepped = core.step(design, state, tap.capture(draw, cycle=cycle), PositioningState(), None, ())
        state = stepped.state
    wear = stepped.snapshot.wear
    off = abs(wear.level - 0.2)
    assert off > 4.0 * wear.level_std
    assert off < 2.5 * np.hypot(wear.level_std, wear.level_common_std)
    assert wear.level_common_std < stepped.snapshot.friction.mu_s.std * 1.01
