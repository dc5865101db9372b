"""Faults of data are found where they were put, told with shot and time, and not found where there are
none."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.errors import CampaignError
from impactcell.features import white_noise_std
from impactcell.german.data_faults import german_data_fault
from impactcell.numerics.spikes import noise_of
from impactcell.quality import Fault, inspect_campaign, notes_of, refuse_unusable
from impactcell.records import Capture, Channel
from tests.taps import Tap

Change = Callable[[Capture], Capture]


@pytest.fixture(scope="module")
def shots() -> tuple[Capture, ...]:
    rng = np.random.default_rng(3)
    made = []
    for number, velocity in enumerate((2500, 3500, 4500, 5500) * 2, 1):
        tap = Tap(
            velocity / 6e4, mass_kg=18.9, stroke_m=1.5e-3, direction=1 if number % 2 else -1, effects={}
        )
        motion = tap.motion()
        time = np.arange(1, round((motion.stop_s + 0.05) * 1e4)) * 1e-4
        force = Channel(time, motion.force_n(time) + rng.normal(0.0, 0.4, time.size))
        position = Channel(time, motion.position_m(time) + rng.normal(0.0, 1.5e-6, time.size))
        made.append(Capture(number, tap.velocity_m_s, 18.9, force, position, direction=tap.direction))
    return tuple(made)


def campaign(shots: tuple[Capture, ...]) -> Campaign:
    return Campaign(Excitation.TAP, shots, stroke_m=1.5e-3)


def changed(shots: tuple[Capture, ...], change: Change, only: int | None = 3) -> Campaign:
    return campaign(tuple(change(shot) if only in (None, shot.cycle) else shot for shot in shots))


def force_of(shot: Capture, values: np.ndarray, kept: np.ndarray | None = None) -> Capture:
    assert shot.force is not None
    rows = np.ones(len(values), dtype=bool) if kept is None else kept
    return replace(shot, force=Channel(shot.force.time_s[rows], values[rows]))


def spiked(shot: Capture) -> Capture:
    assert shot.force is not None
    values = shot.force.values.copy()
    values[[400, 700]] += (40.0, -25.0)
    return force_of(shot, values)


def clipped(shot: Capture) -> Capture:
    assert shot.force is not None
    return force_of(shot, np.minimum(shot.force.values, 120.0))


def gapped(shot: Capture) -> Capture:
    assert shot.force is not None
    kept = np.ones(len(shot.force.values), dtype=bool)
    kept[300:350] = False
    return force_of(shot, shot.force.values, kept)


def stuck(shot: Capture) -> Capture:
    assert shot.force is not None
    values = shot.force.values.copy()
    values[40:80] = values[40]
    return force_of(shot, values)


def constant(shot: Capture) -> Capture:
    assert shot.force is not None
    return force_of(shot, np.full(len(shot.force.values), 2.5))


def drifting(shot: Capture) -> Capture:
    assert shot.force is not None
    return force_of(shot, shot.force.values + 1.5 * shot.cycle)


def wandering(shot: Capture) -> Capture:
    assert shot.force is not None
    return force_of(shot, shot.force.values + np.random.default_rng(shot.cycle).normal(0.0, 2.0))


def humming(shot: Capture) -> Capture:
    assert shot.force is not None
    phase = np.random.default_rng(shot.cycle).uniform(0.0, 2.0 * np.pi)
    return force_of(shot, shot.force.values + 2.0 * np.sin(2.0 * np.pi * 50.0 * shot.force.time_s + phase))


def late(shot: Capture) -> Capture:
    assert shot.force is not None
    return replace(shot, force=Channel(shot.force.time_s + 5e-4, shot.force.values))


def moved_by(path: Callable[[np.ndarray], np.ndarray]) -> Change:
    def change(shot: Capture) -> Capture:
        assert shot.position is not None
        noise = np.random.default_rng(shot.cycle).normal(0.0, 1.5e-6, len(shot.position.values))
        return replace(shot, position=Channel(shot.position.time_s, path(shot.position.time_s) + noise))

    return change


resting = moved_by(np.zeros_like)
springing = moved_by(lambda time: 2e-4 * np.exp(-(((time - 0.02) / 0.005) ** 2)))


def test_clean_data_are_clean(shots: tuple[Capture, ...]) -> None:
    assert inspect_campaign(campaign(shots)) == ()


def test_hum_is_no_zero_that_wanders(shots: tuple[Capture, ...]) -> None:
    assert inspect_campaign(changed(shots, humming, None)) == ()


@pytest.mark.parametrize(
    ("change", "only", "fault", "told"),
    [
        (spiked, 3, Fault.OUTLIERS, "shot 3: 2 outliers in the force, the first at 0.0401 s"),
        (clipped, 3, Fault.CLIPPING, "shot 3: the force stands at its upper end, 120, for"),
        (gapped, 3, Fault.DROPOUTS, "missing in 1 place, the first for 5.1 ms from 0.03 s"),
        (stuck, 3, Fault.DROPOUTS, "for 40 samples from 0.0041 s"),
        (constant, 3, Fault.CONSTANT, "shot 3: the force is constant at 2.5"),
        (drifting, None, Fault.DRIFT, "the force at rest goes from 1."),
        (wandering, None, Fault.DRIFT, "the force at rest is another one in each shot, by "),
        (late, None, Fault.LATE_CHANNEL, "the force is recorded 0.5 ms after the position"),
        (resting, 3, Fault.NO_MOTION, "shot 3: the part does not move"),
        (springing, 3, Fault.PRESLIDING_ONLY, "shot 3: the part never slides: it moves by 0.0002"),
    ],
)
def test_each_fault_is_found_and_told(
    shots: tuple[Capture, ...], change: Change, only: int | None, fault: Fault, told: str
) -> None:
    data_faults = inspect_campaign(changed(shots, change, only))
    assert {data_fault.fault for data_fault in data_faults} == {fault}
    (note,) = notes_of(data_faults)
    assert note.startswith(f"Data, {fault}: ")
    assert told in note
    assert (german_data_fault(note) or "").startswith("Daten, ")


@pytest.mark.parametrize(
    ("change", "told"),
    [(resting, "the part does not move"), (springing, "never slides"), (constant, "is constant")],
)
def test_a_campaign_without_a_slide_is_refused(shots: tuple[Capture, ...], change: Change, told: str) -> None:
    faulty = changed(shots, change, None)
    with pytest.raises(CampaignError, match=rf"{told}.*and so in all 8 shots"):
        refuse_unusable(faulty, inspect_campaign(faulty))
    some = changed(shots, change, 3)
    refuse_unusable(some, inspect_campaign(some))


def test_a_driven_part_that_follows_the_force_never_slides() -> None:
    time = np.arange(2000) * 1e-3
    force = 5.0 * np.sin(9.0 * time)
    noise = np.random.default_rng(0).normal(0.0, 1e-7, time.size)
    shot = Capture(1, float("nan"), 2.0, Channel(time, force), Channel(time, force / 2e5 + noise))
    (data_fault,) = inspect_campaign(Campaign(Excitation.DRIVEN, (shot,)))
    assert data_fault.fault is Fault.PRESLIDING_ONLY


def test_the_end_of_a_swing_is_no_dropout_and_a_channel_that_stood_still_is(
    shots: tuple[Capture, ...],
) -> None:
    """An encoder of 14 400 lines stands for 14 samples where a pendulum turns, and its clock jitters."""
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 40.0, 1e-3)
    read_at = time + 1.5e-3 * (rng.uniform(size=time.size) < 0.3)
    line = 2.0 * np.pi / 14_400
    angle = line * np.round(0.4 * np.exp(-read_at / 80.0) * np.sin(6.0 * read_at) / line)
    angle = np.round(angle, 6)  # as a file has it
    swing = replace(shots[0], force=None, position=Channel(time, angle, None))

    def found(shot: Capture) -> list[str]:
        faults = inspect_campaign(Campaign(Excitation.FREE_SLIDE, (shot,)))
        return [one.message for one in faults if one.fault is Fault.DROPOUTS]

    assert not found(swing)
    angle = angle.copy()
    angle[20_000:20_020] = angle[20_000]  # at full speed
    (told,) = found(replace(swing, position=Channel(time, angle, None)))
    assert "for 20 samples from 20 s (1 such stretches)" in told


def test_a_command_that_waits_for_its_first_step_is_no_dropout(shots: tuple[Capture, ...]) -> None:
    """What a controller made of a coarse encoder, a tenth of a second before the reference steps."""
    rng = np.random.default_rng(8)
    time = np.arange(2000) * 1e-3
    error = np.where(time < 0.1, 0.0, np.exp(-5.0 * np.maximum(time - 0.1, 0.0)))
    command = error + np.where(time < 0.1, 0.0, rng.normal(0.0, 1e-3, time.size))

    def told(values: np.ndarray) -> list[str]:
        waiting = replace(shots[0], force=Channel(time, values))
        faults = inspect_campaign(campaign((waiting, *shots[1:])))
        return [one.message for one in faults if one.fault is Fault.DROPOUTS]

    assert told(command) == []
    command[700:760] = command[700]
    (later,) = told(command)
    assert "for 60 samples from 0.7 s (1 such stretches)" in later


def test_a_coarse_raster_is_no_dropout(shots: tuple[Capture, ...]) -> None:
    def coarse(shot: Capture) -> Capture:
        assert shot.force is not None
        return force_of(shot, np.round(shot.force.values / 2.0) * 2.0)

    assert inspect_campaign(changed(shots, coarse, None)) == ()


def test_a_late_position_is_told_of_the_position(shots: tuple[Capture, ...]) -> None:
    def late_position(shot: Capture) -> Capture:
        assert shot.position is not None
        return replace(shot, position=Channel(shot.position.time_s + 4e-4, shot.position.values))

    (data_fault,) = inspect_campaign(changed(shots, late_position, None))
    assert (data_fault.fault, data_fault.channel) == (Fault.LATE_CHANNEL, "position")


@pytest.mark.parametrize(("raster_n", "raster_m"), [(0.5, 2e-6), (1.0, 5e-6), (5.0, 2e-5)])
def test_a_coarse_raster_is_no_fault(shots: tuple[Capture, ...], raster_n: float, raster_m: float) -> None:
    def rounded(shot: Capture) -> Capture:
        assert shot.force is not None
        assert shot.position is not None
        return replace(
            shot,
            force=Channel(shot.force.time_s, np.round(shot.force.values / raster_n) * raster_n),
            position=Channel(shot.position.time_s, np.round(shot.position.values / raster_m) * raster_m),
        )

    assert inspect_campaign(changed(shots, rounded, None)) == ()


def test_the_noise_that_is_shown_and_that_which_a_fit_weighs_by_agree_but_for_exact_and_coarse_channels() -> (
    None
):
    """A smooth motion beneath, of which both see nothing; a raster r leaves r / sqrt(12)."""
    rng, time = np.random.default_rng(2), np.linspace(0.0, 1.0, 4000)
    motion = np.sin(5.0 * time)
    noisy = motion + rng.normal(0.0, 1e-3, time.size)
    assert noise_of(noisy) == pytest.approx(1e-3, rel=0.05)
    assert white_noise_std(noisy) == pytest.approx(1e-3, rel=0.05)
    coarse = np.round(noisy / 0.02) * 0.02
    exact = np.where(time < 0.3, motion, motion[1200])
    for values, least in ((coarse, 0.02 / math.sqrt(12.0)), (exact, 0.0)):
        assert noise_of(values) == 0.0
        assert white_noise_std(values) > 0.99 * least


def test_a_shot_with_the_samples_of_another_is_told(shots: tuple[Capture, ...]) -> None:
    copied = replace(shots[1], cycle=9)
    found = inspect_campaign(campaign((*shots, copied)))
    assert [(one.fault, one.shot) for one in found] == [(Fault.COPY, 9)]
    assert notes_of(found)[0].startswith("Data, copy: shot 9: its samples are those of shot 2, noise and all")
    flat = Channel(np.arange(200) * 1e-4, np.zeros(200))
    exact = tuple(replace(shot, force=flat, position=flat) for shot in shots[:2])
    assert not any(one.fault is Fault.COPY for one in inspect_campaign(campaign(exact)))
