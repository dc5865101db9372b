"""Records that begin before contact show contact by their samples only: each shot has an onset of its own."""

from dataclasses import replace

import numpy as np
import pytest

from impactcell.campaign import Campaign
from impactcell.discrepancy.data import prepare, shot_set
from impactcell.discrepancy.model import Problem
from impactcell.records import Capture, Channel
from tests.discrepancy import study
from tests.discrepancy.study import Job, campaign, name_effects

FINER = 8
"""How many times as often the plant is sampled as the logger samples it."""
JOB = Job("none", (), 5_060_000, shots=30)
"""With contact put where the force begins, good to a part of a step, this was a gap of 1.16 noise floors."""


def logged(job: Job) -> tuple[Campaign, list[float]]:
    """The campaign of a job as a logger has it: contact lies anywhere between two samples.

    Returns
    -------
    campaign : Campaign
    onsets : list of float
        Time of contact of each shot [s].
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "RATE_HZ", FINER * study.RATE_HZ)
        fine = campaign(job)
    rng = np.random.default_rng([job.seed, 77])
    shots, onsets = [], []
    for shot in fine.shots:
        phase, before = int(rng.integers(FINER)), int(rng.integers(20, 60))
        shots.append(_logged_shot(shot, phase, before, rng))
        assert shot.force is not None
        onsets.append(before / study.RATE_HZ - float(shot.force.time_s[phase]))
    return replace(fine, shots=tuple(shots)), onsets


def _logged_shot(shot: Capture, phase: int, before: int, rng: np.random.Generator) -> Capture:
    def seen(channel: Channel | None, speed_m_s: float) -> Channel | None:
        if channel is None:
            return None
        time_s, values = channel.time_s[phase::FINER], channel.values[phase::FINER]
        earlier_s = time_s[0] - np.arange(before, 0, -1) / study.RATE_HZ
        noise = channel.noise_std * rng.standard_normal(before) if channel.noise_std else np.zeros(before)
        time_s, values = np.append(earlier_s, time_s), np.append(speed_m_s * earlier_s + noise, values)
        return replace(channel, time_s=time_s - time_s[0], values=values)

    return replace(
        shot,
        force=seen(shot.force, 0.0),
        position=seen(shot.position, 0.0),
        actuator=seen(shot.actuator, shot.velocity_m_s),
    )


def test_nothing_hidden_is_no_gap_and_each_onset_is_found() -> None:
    given, onsets = logged(JOB)
    found = name_effects(given, seed=JOB.seed)
    assert found.conclusion.verdict == "no_gap"
    # By the clock of the logger: of the first sample that is kept, less how long after contact it is.
    first_s = [float(shot.times[0][0]) for shot in found.problem.shots.items]
    sizes = [len(shot.times[0]) for shot in found.problem.shots.items]
    clocks = [given.shots[int(i)].force for i in found.training]
    kept_s = [clock.time_s[-size] for clock, size in zip(clocks, sizes, strict=True) if clock is not None]
    contact_s = np.array(kept_s) - (np.array(first_s) - found.nominal.shot_parameters.onset_s)
    error = contact_s - np.array([onsets[int(i)] for i in found.training])
    step_s = 1.0 / study.RATE_HZ
    assert error.std() < 0.02 * step_s
    assert abs(error.mean()) < 0.02 * step_s


def test_a_record_that_begins_with_contact_has_no_onset_to_be_found() -> None:
    for given, free in ((campaign(JOB), False), (logged(JOB)[0], True)):
        prepared = prepare(given)
        steps = {shot.onset_step_s for shot in prepared.shots}
        assert all((step > 0.0) == free for step in steps)
        first = min(float(times[0]) for shot in prepared.shots for times in shot.times if times.size)
        assert first > max(steps)


def test_an_onset_stays_within_its_step() -> None:
    prepared = prepare(logged(JOB)[0])
    everything = shot_set(prepared, np.arange(len(prepared.shots)), (0.4, 1.5e-6, 1.5e-6))
    problem = Problem(everything, len(prepared.batches))
    steps = np.zeros((problem.count, len(problem.shot_parameter_names)))
    steps[:, problem.shot_parameter_names.index("onset_s")] = 1.0
    moved = problem.step_shot_parameters(problem.initial_guess(), steps)
    np.testing.assert_array_equal(moved.onset_s, problem.onset_step_s)
    assert problem.onset_step_s == pytest.approx(1.0 / study.RATE_HZ)


def test_force_at_first_contact_itself_is_no_gap() -> None:
    """There it jumps from 0 to b v: shown as 0, it had been called a lag of the sensor or a ramp."""

    def begun(shot: Capture) -> Capture:
        force = shot.force
        assert force is not None
        since = force.time_s > 0.0
        time_s, values = np.append(0.0, force.time_s[since]), np.append(0.0, force.values[since])
        return replace(shot, force=replace(force, time_s=time_s, values=values))

    given = campaign(JOB)
    found = name_effects(replace(given, shots=tuple(map(begun, given.shots))), seed=JOB.seed)
    assert found.conclusion.verdict == "no_gap"
