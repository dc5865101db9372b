"""Films of a swing by scipy's integrator: noise outweighs what slows the bob down, or hides a second one."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import (
    BaseModel,
    MachineFinding,
    NumberPrior,
    TermChoice,
    investigate_machine,
)
from impactcell.discrepancy.machine.records.motion_scale import half_supports, motion_scale, widening
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.machine.regression.weak_form import build_rows
from impactcell.discrepancy.report import german_machine_sentences, german_sentences
from impactcell.discrepancy.report.machine_result import machine_document
from impactcell.records import Capture, Channel

pytestmark = pytest.mark.slow

GRAVITY = 19.62
FREE = NumberPrior(GRAVITY, math.inf)


@lru_cache
def swing(released: float, viscous: float, drag: float, coulomb: float, rate_hz: float) -> np.ndarray:
    time = np.arange(0.0, 40.0, 1.0 / rate_hz)

    def rates(_: float, state: np.ndarray) -> tuple[float, float]:
        q, v = state
        against = viscous * v + drag * v * abs(v) + coulomb * math.tanh(v / 1e-3)
        return v, -GRAVITY * math.sin(q) - against

    run = solve_ivp(rates, (0.0, 40.0), (released, 0.0), t_eval=time, rtol=1e-9, atol=1e-11, max_step=0.02)
    return np.array(run.y[0])


def films(
    viscous: float = 0.0,
    drag: float = 0.0,
    coulomb: float = 0.0,
    *,
    noise: float = 5e-3,
    rate_hz: float = 30.0,
    tilt: float = 0.0,
) -> Campaign:
    """Four films of a bob on a string, by a camera that may be tilted."""
    rng = np.random.default_rng(1)
    shots = []
    for number, released in enumerate((0.5, 0.9, 1.2, 0.9), 1):
        angle = swing(released, viscous, drag, coulomb, rate_hz)
        read = Channel(np.arange(angle.size) / rate_hz, angle + tilt + rng.normal(0.0, noise, angle.size))
        shots.append(Capture(number, math.nan, math.nan, None, read))
    return Campaign(Excitation.FREE_SLIDE, tuple(shots), coordinate=Coordinate.ROTATION)


def base_of(gravity: NumberPrior = FREE, zero: NumberPrior | None = None, *terms: str) -> BaseModel:
    return BaseModel(
        coordinate=Coordinate.ROTATION,
        inertia=NumberPrior(1.0),
        gravity_torque=gravity,
        position_offset=zero or NumberPrior(),
        terms=tuple(map(TermChoice, terms)),
    )


def value_and_interval(finding: MachineFinding, name: str) -> tuple[float, float, float]:
    fit = finding.final.fit
    place = [column[0] for column in fit.columns].index(name)
    return float(fit.coefficients[place]), float(fit.low[place]), float(fit.high[place])


def test_a_second_friction_that_the_noise_hides_is_told_beside_the_first() -> None:
    """Named alone, the drag takes over the viscous part, and its interval misses by five of its errors."""
    campaign = films(viscous=0.03, drag=0.05)
    finding = investigate_machine(campaign, base_of())
    assert finding.established == ("quadratic_drag",)
    assert finding.is_at_floor
    strengths = {one.name: one for one in finding.clear_strengths}
    assert strengths["viscous_friction"].low < 0.03 < strengths["viscous_friction"].high
    document = machine_document(finding)
    assert "viscous_friction" in document["remaining"]["hints"]
    assert document["verdict"] in {"named", "tied"}
    told = [note for note in document["notes"] if "yet beside quadratic drag over all blocks" in note]
    assert len(told) == 1
    assert any(
        note.startswith("The intervals of what is named are those without it") for note in finding.notes
    )
    for note in finding.notes:
        language, german = german_machine_sentences.note(note)
        assert language == "de"
        assert "beside" not in german


def test_with_both_in_the_base_model_neither_is_off() -> None:
    """What the hint asks for."""
    base = base_of(FREE, None, "quadratic_drag", "viscous_friction")
    finding = investigate_machine(films(viscous=0.03, drag=0.05), base)
    assert (finding.verdict, finding.clear_strengths) == ("no_gap", ())
    for name, strength in (("quadratic_drag", 0.05), ("viscous_friction", 0.03)):
        value, low, high = value_and_interval(finding, name)
        assert value == pytest.approx(strength, rel=0.15)
        assert low < strength < high


@pytest.mark.parametrize(("tilt", "gravity"), [(0.04, FREE), (0.08, NumberPrior(GRAVITY))])
def test_a_camera_that_is_tilted_is_no_other_gravity(tilt: float, gravity: NumberPrior) -> None:
    """A line in the tilt from 0 has a gravity of cos(tilt) of it, or a gap where that is held."""
    finding = investigate_machine(films(noise=5e-4, tilt=tilt), base_of(gravity, NumberPrior(0.0, 0.05)))
    assert finding.verdict == "no_gap"
    assert finding.final.gravity == pytest.approx(GRAVITY, rel=2e-4)
    told = machine_document(finding)["nominal"]["position_offset"]
    assert told["value"] == pytest.approx(tilt, abs=2e-4)
    assert told["ci95"][0] < told["value"] < told["ci95"][1]


def test_where_a_number_explains_all_no_term_is_hinted_at() -> None:
    """Gravity is 3 % too large, all is held and nothing fitted: no traceback, and no spring to try."""
    finding = investigate_machine(films(noise=8e-3), base_of(NumberPrior(1.03 * GRAVITY)))
    assert finding.number_off == "gravity_torque"
    assert finding.better_simulated is None
    assert not any("in the base model and compare" in note for note in finding.notes)


def test_friction_beside_a_gravity_that_is_off_is_no_law_that_nobody_had_listed() -> None:
    finding = investigate_machine(films(coulomb=0.12, noise=8e-3), base_of(NumberPrior(1.03 * GRAVITY)))
    assert finding.law is None
    assert "Coulomb friction beside another torque of gravity does as well as any law" in finding.law_refused
    language, german = german_sentences.reason(finding.law_refused)
    assert language == "de"
    assert "Coulombsche Reibung" in german


@pytest.mark.parametrize("noise", [1e-3, 1e-2])
def test_the_noise_floor_of_a_row_is_what_noise_makes_of_it(noise: float) -> None:
    """Acceleration and gravity err together: of a swing without noise, filmed 200 times with some."""
    rate_hz, base = 30.0, base_of(NumberPrior(GRAVITY))
    angle = swing(0.9, 0.0, 0.0, 0.0, rate_hz)[:600]
    [record] = uniform_records(films(noise=noise), base)[:1]
    rng = np.random.default_rng(5)
    # The scale is that of one film, so that all rows stand at the same places.
    scale = motion_scale([replace(record, noise=(noise, 0.0))], base.response, GRAVITY)
    targets = []
    for _ in range(200):
        read = angle + rng.normal(0.0, noise, angle.size)
        one = replace(
            record,
            time_s=np.arange(angle.size) / rate_hz,
            position=read,
            force=np.zeros(angle.size),
            noise=(noise, 0.0),
        )
        rows = build_rows([one], base, {}, (GRAVITY, 0.0))
        targets.append(rows.target[:8])
    assert half_supports(record, scale)[0] >= 5
    found = np.mean(np.var(targets, axis=0))
    assert found == pytest.approx(float(np.mean(rows.variance[:8])), rel=0.15)


def test_supports_are_widened_by_noise_where_nothing_drives() -> None:
    quiet, loud = (uniform_records(films(noise=noise), base_of()) for noise in (1e-5, 1e-2))
    scales = [motion_scale(records, base_of().response, GRAVITY) for records in (quiet, loud)]
    assert widening(quiet, scales[0]) == pytest.approx(1.0, abs=0.1)
    assert 2.0 < widening(loud, scales[1]) < 4.2
    driven = [replace(record, force=record.force + 1.0) for record in loud]
    assert widening(driven, scales[1]) == pytest.approx(1.0, abs=0.1)
