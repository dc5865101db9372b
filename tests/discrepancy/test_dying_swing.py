"""A swing that dies away: nearly all of what a term explains is in the first blocks of one record."""

import json
import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.api.machine_findings import write_machine_findings
from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import BaseModel, MachineFinding, NumberPrior, investigate_machine
from impactcell.discrepancy.machine.simulation.held_out import simulate_held_out
from impactcell.discrepancy.report.machine_result import machine_document
from impactcell.records import Capture, Channel

pytestmark = pytest.mark.slow

GRAVITY, COULOMB = 30.0, 0.1
"""m g l and Coulomb friction over the inertia, 1/s²: at rest after a minute from 1.2 rad."""
PENDULUM = BaseModel(
    coordinate=Coordinate.ROTATION, inertia=NumberPrior(1.0), gravity_torque=NumberPrior(GRAVITY, math.inf)
)


@lru_cache
def swing(drag: float, viscous: float, rate_hz: float = 200.0, noise: float = 1e-4) -> Capture:
    """One swing, by an integrator of its own."""

    def rates(_: float, state: np.ndarray) -> tuple[float, float]:
        q, v = state
        against = COULOMB * math.tanh(v / 1e-3) + drag * v * abs(v) + viscous * v
        return v, -GRAVITY * math.sin(q) - against

    time = np.arange(0.0, 60.0, 1.0 / rate_hz)
    run = solve_ivp(rates, (0.0, 60.0), (1.2, 0.0), t_eval=time, rtol=1e-9, atol=1e-11, max_step=0.01)
    angle = run.y[0] + np.random.default_rng(0).normal(0.0, noise, time.size)
    return Capture(1, math.nan, math.nan, None, Channel(time, angle, None))


@lru_cache
def finding(drag: float, viscous: float) -> MachineFinding:
    """What the base model of Coulomb friction lacks on it."""
    campaign = Campaign(Excitation.FREE_SLIDE, (swing(drag, viscous),), coordinate=Coordinate.ROTATION)
    return investigate_machine(campaign, PENDULUM)


@pytest.mark.parametrize(
    ("drag", "viscous", "name", "parameter"),
    [
        (0.05, 0.0, "quadratic_drag", "drag_coefficient_n_m_s2_per_rad2"),
        (0.0, 0.05, "viscous_friction", "viscous_coefficient_n_m_s_per_rad"),
    ],
)
def test_what_slows_it_down_is_named(drag: float, viscous: float, name: str, parameter: str) -> None:
    found = finding(drag, viscous)
    assert (found.verdict, found.established) == ("named", (name,))
    [effect] = machine_document(found)["effects"]
    assert effect["tied_with"] == []
    assert effect["parameters"][parameter]["value"] == pytest.approx(0.05, rel=0.03)
    assert found.fall.before > 10.0
    assert found.fall.after < 1.3
    assert found.simulated[-1].rmse < 0.2 * found.simulated[0].rmse


def test_a_model_that_runs_away_is_told_as_one(tmp_path: Path) -> None:
    """A resistance that feeds the swing: no number overflows, and the report says how far off it is."""
    found = finding(0.05, 0.0)
    fit = found.final.fit
    feeding = np.where([name == "quadratic_drag" for name, _, _ in fit.columns], -5.0, fit.coefficients)
    model = replace(found.final, fit=replace(fit, coefficients=feeding))
    error = simulate_held_out(found, model)
    assert math.isfinite(error.rmse)
    assert error.fit_percent < -1000.0
    shown = replace(found, final=model, simulated=(found.simulated[0], error))
    campaign = Campaign(Excitation.FREE_SLIDE, (swing(0.05, 0.0),), coordinate=Coordinate.ROTATION)
    write_machine_findings(shown, campaign, tmp_path / "found", "a swing")
    headline = json.loads((tmp_path / "found" / "result.json").read_text(encoding="utf-8"))["headline"]
    assert "does not follow the held-out position: it errs" in headline


@pytest.mark.parametrize(
    ("drag", "noise", "verdict"), [(0.05, 5e-3, "named"), (0.05, 2e-2, "tied"), (0.0, 5e-3, "no_gap")]
)
def test_what_slows_it_down_is_seen_in_a_film(drag: float, noise: float, verdict: str) -> None:
    """A camera at 30 Hz that is off by 5 or 20 mrad: rows of a quarter of a swing showed nothing of it."""
    campaign = Campaign(
        Excitation.FREE_SLIDE, (swing(drag, 0.0, 30.0, noise),), coordinate=Coordinate.ROTATION
    )
    found = investigate_machine(campaign, PENDULUM)
    assert found.fall.after < 1.3
    assert found.verdict == verdict
    if drag:
        assert found.established == ("quadratic_drag",)
        [effect] = machine_document(found)["effects"]
        value = effect["parameters"]["drag_coefficient_n_m_s2_per_rad2"]["value"]
        assert value == pytest.approx(drag, rel=0.2)
        assert [*effect["tied_parameters"]] == effect["tied_with"]
        # A drag c takes as much as a viscous friction of c times a speed, which is 6.2 rad/s at most.
        if viscous := effect["tied_parameters"].get("viscous_friction"):
            coefficient = viscous["viscous_coefficient_n_m_s_per_rad"]
            assert coefficient["ci95"][0] < coefficient["value"] < coefficient["ci95"][1]
            assert drag < coefficient["value"] < 6.2 * drag


def test_nothing_is_named_where_nothing_is_missing() -> None:
    assert finding(0.0, 0.0).verdict == "no_gap"
