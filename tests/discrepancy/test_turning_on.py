"""A motor that turns on one way while its friction drifts: no law of its place explains that.

scipy's integrator turns it; the torque has noise, and friction rises slowly with time.
"""

import math
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.laws import Tangent
from impactcell.discrepancy.machine import BaseModel, MachineFinding, NumberPrior, TermChoice
from impactcell.discrepancy.machine.laws.law_forms import nearest_forms
from impactcell.discrepancy.machine.records.travel import may_repeat, periods_of_a_turn, turns_on
from impactcell.discrepancy.machine.terms.rival_forms import SPLINE_PIECES, splines
from impactcell.discrepancy.report import german_sentences
from impactcell.records import Capture, Channel, Samples
from tests.discrepancy.machine_study import establish_in

INERTIA, VISCOUS, COULOMB, SPEED = 2e-3, 2e-4, 0.02, 200.0
"""kg m², N m s/rad, N m, rad/s."""
TURN = 2.0 * math.pi
TONES = ((0.31, 0.015), (0.83, 0.010), (1.7, 0.008))
"""Hz and N m of the drive beside its mean."""
BASE = BaseModel(
    coordinate=Coordinate.ROTATION,
    inertia=NumberPrior(INERTIA, math.inf),
    terms=(TermChoice("viscous_friction"),),
    force_offset=NumberPrior(0.0, math.inf),
    block_s=1.0,
)


def drive(time: Samples | float, phases: Samples) -> Samples | float:
    tones = [size * np.sin(TURN * hz * time + at) for (hz, size), at in zip(TONES, phases, strict=True)]
    return COULOMB + VISCOUS * SPEED + sum(tones)


@lru_cache
def drifting() -> MachineFinding:
    """What two records of 40 s show, friction 60 % more at their end than at their begin."""
    time, shots = np.arange(0.0, 40.0, 5e-3), []
    for number in (1, 2):
        rng = np.random.default_rng(number)
        phases = rng.uniform(0.0, TURN, len(TONES))

        def rates(seconds: float, state: np.ndarray, phases: Samples = phases) -> list[float]:
            friction = COULOMB * (1.0 + 0.6 * seconds / 40.0) + VISCOUS * state[1]
            return [state[1], (drive(seconds, phases) - friction) / INERTIA]

        path = solve_ivp(rates, (0.0, 40.0), [0.0, SPEED], t_eval=time, rtol=1e-8, max_step=0.02).y[0]
        torque = drive(time, phases) + rng.normal(0.0, 2e-3, time.size)
        read = path + rng.normal(0.0, 1e-3, time.size)
        shots.append(
            Capture(number, math.nan, math.nan, Channel(time, torque, None), Channel(time, read, None))
        )
    campaign = Campaign(Excitation.DRIVEN, tuple(shots), coordinate=Coordinate.ROTATION)
    return establish_in(campaign, BASE)


@pytest.mark.slow
def test_friction_that_drifts_while_a_motor_turns_on_is_no_law_of_its_place() -> None:
    finding = drifting()
    assert (finding.established, finding.unconfirmed) == ((), ())
    tried = {trial.term for step in finding.steps for trial in step.trials}
    of_place = {term.choice.identifier for term in tried}
    assert not of_place & {"position_dependent_friction", "restoring_force", "hardening_spring"}
    periods = {term.shape for term in tried if term.choice.identifier.startswith("periodic_")}
    assert periods
    assert max(periods) <= 1.5 * TURN or max(periods) in (360.0, 540.0)


@pytest.mark.slow
def test_that_no_law_of_the_place_is_looked_for_is_said_in_both_languages() -> None:
    finding = drifting()
    assert turns_on(finding.records, Coordinate.ROTATION)
    assert not turns_on(finding.records, Coordinate.TRANSLATION)
    said = [note for note in finding.notes if note.startswith("Every record turns on one way, through ")]
    assert len(said) == 1
    assert german_sentences.note(said[0])[0] == "de"


@pytest.mark.parametrize(
    ("period", "coordinate", "travel", "may"),
    [
        (0.3, Coordinate.TRANSLATION, 0.2, False),
        (0.2, Coordinate.TRANSLATION, 0.2, True),
        (TURN, Coordinate.ROTATION, 1.0, True),  # gravity, of a swing
        (1.5 * TURN, Coordinate.ROTATION, 1.0, False),
        (1.5 * TURN, Coordinate.ROTATION, 2.0 * TURN, True),
        (2300.0 * TURN, Coordinate.ROTATION, 575.0 * TURN, False),
        (100.0 * TURN, Coordinate.ROTATION, 575.0 * TURN, False),
        (TURN, Coordinate.ROTATION, 575.0 * TURN, True),
        (TURN / 7.0, Coordinate.ROTATION, 575.0 * TURN, True),
        (TURN / 7.5, Coordinate.ROTATION, 575.0 * TURN, False),
        (1.04 * TURN, Coordinate.ROTATION, 5.0 * TURN, True),  # half a wave over five turns is a tenth of one
        (1.2 * TURN, Coordinate.ROTATION, 5.0 * TURN, False),
        (360.0, Coordinate.ROTATION, 720.0, True),  # degrees, which is asked about
    ],
)
def test_after_which_periods_a_law_of_position_may_repeat(
    period: float, coordinate: Coordinate, travel: float, may: bool
) -> None:
    assert may_repeat(period, coordinate, -0.5 * travel, 0.5 * travel) is may


def test_the_periods_of_what_turns_are_its_turn_and_the_parts_of_it() -> None:
    periods = periods_of_a_turn(100.0)
    assert list(periods) == sorted(periods)
    assert [TURN / period for period in periods[:-1]] == pytest.approx(range(24, 0, -1))
    assert TURN not in (periods[0], periods[-1])  # what is at an end is not named
    assert 360.0 in periods_of_a_turn(720.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("coordinate", "form", "is_periodic"),
    [
        (Coordinate.TRANSLATION, "force_over_position", False),
        (Coordinate.ROTATION, "force_over_position", False),
        (Coordinate.ROTATION, "friction_over_speed", True),
    ],
)
def test_no_wave_longer_than_the_travel_is_proposed(
    coordinate: Coordinate, form: str, is_periodic: bool
) -> None:
    """Of what is a quarter of a wave over the range, forms of position are no waves."""
    low, high, count = 0.0, 400.0, SPLINE_PIECES + 3
    u = np.linspace(low, high, 900)
    basis = splines(u, low, high).T
    fitted = np.linalg.lstsq(basis, np.sin(TURN * u / (4.0 * high)))[0]
    information = 1e4 * basis.T @ basis
    known = Tangent(
        information, information @ fitted, low, high, 900, False, fitted, np.zeros(0), np.zeros((0, count))
    )
    forms = nearest_forms(form, known, (low, high), coordinate)
    assert forms
    waves = [choice for choice in forms if choice.law is not None and "2pi" in choice.law.name]
    assert bool(waves) is is_periodic
