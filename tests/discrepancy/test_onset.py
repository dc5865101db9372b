"""A logger shows contact by its samples only: each shot has an onset of its own. An exact one has none."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from impactcell.discrepancy.data import prepare, sensor_noise, shot_set, split_held_out
from impactcell.discrepancy.model import Problem, fit, fit_nominal
from impactcell.discrepancy.model.shot_freedom import ShotFreedom
from impactcell.discrepancy.nominal_model import nominal_models
from impactcell.discrepancy.report.german_notes import note
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.records import Capture
from tests.discrepancy import study
from tests.discrepancy.study import Job, campaign, logged, name_effects

pytestmark = pytest.mark.slow

JOB = Job("none", (), 5_060_000, shots=30)
"""With contact put where the force begins, good to a part of a step, this was a gap of 1.16 noise floors."""
BEFORE = (20, 60)
"""Samples before contact of records that begin earlier."""
STEP_S = 1.0 / study.RATE_HZ
LIBRARY = (
    "quadratic_drag", "hertz_contact", "adhesion", "channel_skew", "force_sensor_lag", "actuator_ramp",
    "actuator_droop", "presliding_compliance",
)  # fmt: skip
"""What may be named: what is hidden, and what late contact could be taken for; fewer to try are faster."""
NOTE = "First contact lies"
"""How the note begins that says so."""


def notes_of_contact(found: DiscrepancyResult) -> list[str]:
    return [one for one in found.prepared.notes if one.startswith(NOTE)]


def test_nothing_hidden_is_no_gap_and_each_onset_is_found() -> None:
    given, onsets = logged(JOB, before=BEFORE)
    found = name_effects(given, seed=JOB.seed)  # against all that there is
    assert found.conclusion.verdict == "no_gap"
    # By the clock of the logger: of the first sample that is kept, less how long after contact it is.
    first_s = [float(shot.times[0][0]) for shot in found.problem.shots.items]
    kept = [float(shot.values[0][0]) for shot in found.problem.shots.items]
    clocks = [given.shots[int(i)].force for i in found.training]
    kept_s = [
        float(clock.time_s[clock.values == first][0])
        for clock, first in zip(clocks, kept, strict=True)
        if clock is not None
    ]
    contact_s = np.array(kept_s) - (np.array(first_s) - found.nominal.shot_parameters.onset_s)
    error = contact_s - np.array([onsets[int(i)] for i in found.training])
    assert error.std() < 0.02 * STEP_S
    assert abs(error.mean()) < 0.02 * STEP_S
    assert not notes_of_contact(found)


def test_a_record_that_begins_with_contact_has_no_onset_to_be_found() -> None:
    for given, free in ((campaign(JOB), False), (logged(JOB, before=BEFORE)[0], True)):
        prepared = prepare(given)
        steps = {shot.onset_step_s for shot in prepared.shots}
        assert all((step > 0.0) == free for step in steps)
        first = min(float(times[0]) for shot in prepared.shots for times in shot.times if times.size)
        assert first > max(steps)


def test_records_of_which_one_begins_before_contact_all_have_an_onset() -> None:
    given = campaign(JOB)
    first = given.shots[0].position
    assert first is not None
    time_s, values = np.append(-STEP_S, first.time_s), np.append(0.0, first.values)
    early = replace(given.shots[0], position=replace(first, time_s=time_s, values=values))
    prepared = prepare(replace(given, shots=(early, *given.shots[1:])))
    assert all(shot.onset_step_s == pytest.approx(STEP_S) for shot in prepared.shots)


@pytest.mark.parametrize("replicates", [True, False])
def test_contact_between_samples_is_seen_in_records_that_begin_with_it(replicates: bool) -> None:
    """A record of the first sample of contact and what follows; taken as told, the gap would be 2 to 4."""
    job = replace(JOB, replicates=replicates)
    given, onsets = logged(job)
    found = name_effects(given, seed=job.seed, library=LIBRARY)
    assert found.conclusion.verdict == "no_gap"
    error = found.nominal.shot_parameters.onset_s - np.array([onsets[int(i)] for i in found.training])
    assert np.abs(error).max() < 0.05 * STEP_S
    (said,) = notes_of_contact(found)
    told = re.fullmatch(r"First contact lies (-\d+) to (-\d+) µs from t = 0, within a .*", said)
    assert told
    ends = np.quantile([1e6 * onsets[int(i)] for i in found.training], (0.0, 1.0))
    np.testing.assert_allclose([float(told[1]), float(told[2])], ends, atol=6.0)
    assert note(said)[0] == "de"


def test_an_effect_is_named_beside_contact_between_samples() -> None:
    job = Job("single", ("quadratic_drag",), 5_060_001, shots=30)
    found = name_effects(logged(job)[0], seed=job.seed, library=LIBRARY)
    assert (found.conclusion.verdict, found.added) == ("named", ("quadratic_drag",))
    assert notes_of_contact(found)
    gap = found.validation.held_out
    assert gap.after.trace < 1.05 < 2.0 < gap.before.trace


def test_a_trigger_that_is_late_by_the_same_in_every_shot_is_no_gap() -> None:
    """No scatter shows it: it is what is left where no effect explains the shots."""

    def late(shot: Capture) -> Capture:
        channels = {
            name: replace(channel, time_s=channel.time_s - 0.3 * STEP_S)
            for name in ("force", "position", "actuator")
            if (channel := getattr(shot, name)) is not None
        }
        return replace(shot, **channels)

    given = campaign(JOB)
    delayed = replace(given, shots=tuple(map(late, given.shots)))
    found = name_effects(delayed, seed=JOB.seed, library=LIBRARY)
    assert (found.conclusion.verdict, found.added) == ("no_gap", ())
    np.testing.assert_allclose(found.nominal.shot_parameters.onset_s, -0.3 * STEP_S, atol=0.05 * STEP_S)
    assert notes_of_contact(found)


@pytest.mark.parametrize("replicates", [True, False])
@pytest.mark.parametrize(
    "effect", ["hertz_contact", "actuator_droop", "magnetic_pull", "periodic_friction", "friction_drift"]
)
def test_an_effect_does_not_look_like_contact_between_samples(effect: str, replicates: bool) -> None:
    """It moves contact, too, but alike in like shots; where there are none, nothing is said at first."""
    job = Job("single", (effect,), 5_060_002, strength=2.0, shots=30, replicates=replicates)
    prepared = prepare(campaign(job))
    training, _ = split_held_out(prepared, job.seed)
    nominals = nominal_models(prepared, sensor_noise(prepared), training, None)
    assert nominals.start is nominals.exact
    assert not nominals.exact.is_open
    assert nominals.contact_free is not None
    assert nominals.contact_free.is_open
    assert nominals.scatter is not None
    assert nominals.scatter.is_open
    assert math.isnan(nominals.scatter.std_s) != replicates


def test_an_onset_stays_within_its_step() -> None:
    prepared = prepare(logged(JOB, before=BEFORE)[0])
    everything = shot_set(prepared, np.arange(len(prepared.shots)), (0.4, 1.5e-6, 1.5e-6))
    problem = Problem(everything, len(prepared.batches))
    steps = np.zeros((problem.count, len(problem.shot_parameter_names)))
    steps[:, problem.shot_parameter_names.index("onset_s")] = 1.0
    moved = problem.freedom.step(problem.initial_guess(), steps)
    np.testing.assert_array_equal(moved.onset_s, problem.onset_step_s)
    assert problem.onset_step_s == pytest.approx(STEP_S)


def test_a_fit_comes_to_its_optimum_where_contact_of_some_shots_would_lie_beyond_their_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A step of the plant that counts on their contact to go on makes them worse: it held up the fit of all.

    Held against scipy's least squares within bounds, over the plant and every shot's friction and contact.
    """
    prepared = prepare(logged(JOB, before=BEFORE)[0])
    some = shot_set(prepared, np.arange(10), (0.4, 1.5e-6, 1.5e-6))
    free = fit_nominal(Problem(some, len(prepared.batches)))
    step_s = 0.5 * float(np.median(np.abs(free.shot_parameters.onset_s)))
    widest = ShotFreedom.of
    monkeypatch.setattr(ShotFreedom, "of", lambda s: replace(widest(s), onset_step_s=np.full(len(s), step_s)))
    problem = Problem(some, len(prepared.batches))
    model = fit(problem, free.theta, problem.initial_guess())
    shots, count = model.shot_parameters, len(model.theta)
    assert 2 < (np.abs(shots.onset_s) >= step_s).sum() < problem.count

    def residuals(x: np.ndarray) -> np.ndarray:
        theta, factor, onset = np.split(x, [count, count + problem.count])
        own = replace(shots, log_factor=factor, onset_s=onset * step_s)
        return np.append(problem.residual(theta, own), factor / model.spread)

    start = np.concatenate([model.theta, shots.log_factor, shots.onset_s / step_s])
    lower, upper = problem.bounds()
    ends = np.append(np.full(problem.count, np.inf), np.ones(problem.count))
    bounds = (np.append(lower, -ends), np.append(upper, ends))
    best = least_squares(residuals, np.clip(start, *bounds), bounds=bounds, x_scale="jac", diff_step=1e-6)
    assert model.state.cost < 2.0 * best.cost + 1.0


def test_force_at_first_contact_itself_is_no_gap() -> None:
    """There it jumps from 0 to b v: shown as 0, it had been called a lag of the sensor or a ramp."""

    def begun(shot: Capture) -> Capture:
        force = shot.force
        assert force is not None
        since = force.time_s > 0.0
        time_s, values = np.append(0.0, force.time_s[since]), np.append(0.0, force.values[since])
        return replace(shot, force=replace(force, time_s=time_s, values=values))

    given = campaign(JOB)
    shown = replace(given, shots=tuple(map(begun, given.shots)))
    found = name_effects(shown, seed=JOB.seed, library=LIBRARY)
    assert found.conclusion.verdict == "no_gap"
