"""Figures read off captures: unbiased against the simulator's own, or named errors."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.errors import (
    CaptureError,
    ClippedForceError,
    NoBreakawayError,
    NoSeparationError,
    NoStopError,
    PhysicsError,
    PredictionError,
)
from impactcell.features import extract, noise_std, required, white_noise_std
from impactcell.features.channels import check_channel, check_force, displacement
from impactcell.features.contact import loss_of_contact, peak_force
from impactcell.records import Channel
from tests.taps import Tap

TAPS = [
    Tap(2000 / 6e4),
    Tap(4000 / 6e4, mass_kg=12.6, stroke_m=1.5e-3),
    Tap(0.1, mass_kg=25.2, stroke_m=1.5e-3),  # halts within the contact
    Tap(0.1, direction=-1, start_m=0.02),
]


@pytest.mark.parametrize("rate_hz", [1e4, 1e5, 1e6])
@pytest.mark.parametrize("tap", TAPS)
def test_the_peak_is_unbiased_where_the_raw_maximum_is_not(tap: Tap, rate_hz: float) -> None:
    rng = np.random.default_rng(1)
    clean = tap.capture(force_hz=rate_hz).force
    assert clean is not None
    true = tap.motion().peak_force_n
    readings, raw = [], []
    highest = clean.values.max()
    for _ in range(20):
        noisy = replace(clean, values=clean.values + rng.normal(0.0, 0.4, len(clean.values)))
        readings.append(peak_force(check_force(noisy)))
        raw.append(noisy.values.max())
    values = np.array([reading.value for reading in readings])
    assert abs(values.mean() / true - 1.0) < 1e-3
    assert values.std() < 0.3
    assert 0.4 < np.mean([reading.std for reading in readings]) / values.std() < 3.0
    if rate_hz >= 1e6:  # there the peak is flat over hundreds of samples
        assert np.mean(raw) - highest > 0.8


@pytest.mark.parametrize("tap", TAPS)
def test_sliding_distance_and_loss_of_contact_are_those_of_the_motion(tap: Tap) -> None:
    rng = np.random.default_rng(2)
    motion = tap.motion()
    found = [required(extract(tap.capture(rng)).slide) for _ in range(20)]
    distances = np.array([one.distance.value for one in found])
    assert abs(distances.mean() - motion.sliding_distance_m) < 1e-6
    assert distances.std() < 3e-6
    assert 0.4 < np.mean([one.distance.std for one in found]) / distances.std() < 2.5
    assert np.mean([one.separation_s for one in found]) == pytest.approx(motion.separation_s, abs=2e-5)
    assert np.mean([one.stop_s for one in found]) == pytest.approx(motion.stop_s, abs=1e-3)


def test_the_last_of_two_contacts_counts() -> None:
    tap = Tap(2000 / 6e4, stroke_m=5e-3)
    motion = tap.motion()
    assert [event.kind for event in motion.events].count("separation") > 1
    found = required(extract(tap.capture(np.random.default_rng(3))).slide)
    assert found.separation_s == pytest.approx(motion.separation_s, abs=2e-4)
    assert found.distance.value == pytest.approx(motion.sliding_distance_m, abs=1e-5)


def test_the_deceleration_of_a_slide_without_viscous_friction_is_mu_k_g() -> None:
    found = required(extract(Tap(0.08, effects={}).capture(np.random.default_rng(4))).slide)
    assert found.deceleration.value == pytest.approx(0.152 * 9.81, rel=1e-3)


def test_noise_that_is_not_stated_is_found_from_the_samples() -> None:
    capture = Tap().capture(np.random.default_rng(5))
    assert capture.force is not None
    assert noise_std(replace(capture.force, noise_std=None)) == pytest.approx(0.4, rel=0.25)
    assert noise_std(replace(capture.force, resolution=1.2)) == pytest.approx(
        math.hypot(0.4, 1.2 / math.sqrt(12))
    )


def test_a_coarse_raster_does_not_hide_the_peak() -> None:
    capture = Tap().capture(np.random.default_rng(6))
    assert capture.force is not None
    coarse = replace(capture.force, values=np.round(capture.force.values), resolution=1.0)
    assert peak_force(check_force(coarse)).value == pytest.approx(Tap().motion().peak_force_n, abs=0.5)


def channel(values: object) -> Channel:
    array = np.asarray(values, dtype=np.float64)
    return Channel(np.arange(1, len(array) + 1) * 1e-4, array, 0.4)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (None, "no force was recorded"),
        (channel([]), "the force record is empty"),
        (channel([1.0, 2.0]), "only 2 samples"),
        (channel([1.0, math.nan] * 10), "10 of 20 force samples are not numbers"),
        (channel([math.inf] + [0.0] * 20), "1 of 21 force samples are not numbers"),
        (channel([3.0] * 100), "the force is constant at 3"),
        (Channel(np.zeros(20), np.arange(20.0), 0.4), "do not increase"),
        (Channel(np.arange(19.0), np.arange(20.0), 0.4), "20 samples at 19 times"),
    ],
)
def test_channels_nothing_can_be_read_from_are_named(given: Channel | None, message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        check_channel(given, "force")


def test_a_force_without_contact_is_named() -> None:
    noise = channel(np.random.default_rng(7).normal(0.0, 0.4, 400))
    for read in (peak_force, loss_of_contact):
        with pytest.raises(CaptureError, match="no contact"):
            read(check_force(noise))


def test_clipped_force_is_named_by_full_scale_and_by_its_plateau() -> None:
    force = Tap().capture(np.random.default_rng(8)).force
    assert force is not None
    clipped = replace(force, values=np.minimum(force.values, 150.0))
    with pytest.raises(ClippedForceError, match="samples in a row stand at 150 N"):
        peak_force(check_force(clipped))
    with pytest.raises(ClippedForceError, match="at full scale, 150 N"):
        peak_force(check_force(replace(clipped, full_scale=(-10.0, 150.0))))
    peak_force(check_force(replace(force, full_scale=(-10.0, 500.0))))


def test_a_record_that_ends_in_contact_or_in_motion_is_named() -> None:
    capture = Tap().capture(np.random.default_rng(9))
    force, position = capture.force, capture.position
    assert force is not None
    assert position is not None
    short = Channel(force.time_s[:100], force.values[:100], 0.4)
    with pytest.raises(NoSeparationError, match="when its record ended"):
        required(extract(replace(capture, force=short)).slide)
    with pytest.raises(NoStopError, match="still moving"):
        required(
            extract(
                replace(capture, position=Channel(position.time_s[:300], position.values[:300], 1.5e-6))
            ).slide
        )
    with pytest.raises(NoSeparationError):
        required(
            extract(
                replace(capture, position=Channel(position.time_s[:150], position.values[:150], 1.5e-6))
            ).slide
        )


@pytest.mark.parametrize("kind", ["hum", "offset", "drift"])
def test_a_force_that_is_not_zero_without_contact_is_none(kind: str) -> None:
    """A sensor's hum, offset or drift was taken for a contact that lasts, and the tap refused."""
    tap = Tap(3000 / 6e4, effects={})
    capture, motion = tap.capture(np.random.default_rng(8)), tap.motion()
    force = capture.force
    assert force is not None
    time_s = np.arange(1, round((motion.stop_s + 0.02) * 1e4)) / 1e4
    values = np.append(
        force.values, np.random.default_rng(9).normal(0.0, 0.4, len(time_s) - len(force.values))
    )
    idle = {"hum": 2.0 * np.sin(314.16 * time_s + 1.0), "offset": 3.0, "drift": 20.0 * time_s}
    found = required(extract(replace(capture, force=Channel(time_s, values + idle[kind], 0.4))).slide)
    assert found.separation_s == pytest.approx(motion.separation_s, abs=2e-4)
    assert abs(found.distance.value - motion.sliding_distance_m) < 3.0 * found.distance.std
    assert found.deceleration.value == pytest.approx(0.152 * 9.81, rel=2e-3)


def test_a_part_that_does_not_move_is_named() -> None:
    capture = Tap().capture(np.random.default_rng(10))
    still = channel(np.random.default_rng(11).normal(0.0, 1.5e-6, 600))
    with pytest.raises(NoBreakawayError, match="moved less than"):
        required(extract(replace(capture, position=replace(still, noise_std=1.5e-6))).slide)


def test_any_part_of_a_capture_is_read_or_refused_by_name() -> None:
    capture = Tap().capture(np.random.default_rng(12))
    assert capture.force is not None
    assert capture.position is not None
    for first in range(0, 300, 23):
        for last in range(first + 8, 400, 37):
            force = Channel(capture.force.time_s[first:last], capture.force.values[first:last], 0.4)
            position = Channel(
                capture.position.time_s[first:last], capture.position.values[first:last], 1.5e-6
            )
            try:
                peak_force(check_force(force))
                found = required(extract(replace(capture, force=force, position=position)).slide)
            except (PredictionError, PhysicsError):
                continue
            assert math.isfinite(found.distance.value)


def test_positions_are_counted_from_where_the_part_lay() -> None:
    tap = Tap(start_m=-0.03)
    for from_table_zero in (True, False):
        capture = tap.capture(from_table_zero=from_table_zero)
        assert displacement(capture).values[0] == pytest.approx(0.0, abs=1e-5)


def test_a_channel_that_cannot_be_used_is_named_in_the_place_of_its_features() -> None:
    flat = Channel(np.arange(20) * 1e-3, np.ones(20))
    features = extract(replace(Tap().capture(np.random.default_rng(13)), force=flat))
    for feature in (
        features.force,
        features.peak_force,
        features.separation,
        features.slide,
        features.segment,
    ):
        with pytest.raises(CaptureError, match="the force is constant"):
            required(feature)
    assert required(features.position).sigma == 1.5e-6


def test_the_segment_is_the_slide_from_separation_to_just_before_rest() -> None:
    tap = Tap(0.06, direction=-1, start_m=0.01, effects={})
    motion = tap.motion()
    features = extract(tap.capture(np.random.default_rng(14)))
    segment, slide = required(features.segment), required(features.slide)
    assert segment.distance_m[-1] == pytest.approx(slide.distance.value, abs=3e-5)
    assert slide.separation_s + segment.time_s[-1] < motion.stop_s
    true = motion.position_m(slide.separation_s + segment.time_s) - motion.position_m(
        np.array([motion.separation_s])
    )
    assert segment.distance_m == pytest.approx(-true, abs=5e-6)
    fitted = np.polyfit(segment.time_s, segment.distance_m, 2)
    assert -2.0 * fitted[0] == pytest.approx(0.152 * 9.81, rel=5e-3)


def test_noise_is_found_beside_a_motion_and_beside_jumps() -> None:
    rng = np.random.default_rng(15)
    times = np.linspace(0.0, 1.0, 2000)
    values = 3.0 + 40.0 * times**2 + np.where(times > 0.5, 10.0, 0.0) + rng.normal(0.0, 0.02, 2000)
    assert white_noise_std(values) == pytest.approx(0.02, rel=0.1)
    coarse = np.round(values[:900] * 0.5) / 0.5  # more than half of the differences are zero
    assert 0.0 < white_noise_std(coarse) < 2.0
    assert math.isnan(white_noise_std(values[:3]))


def test_a_raster_in_decimals_is_no_silence() -> None:
    """Equal steps of 5 µm, read from decimals, differ by rounding; that was taken for all the noise."""
    steps = np.ones(600)
    steps[::7] = 2.0
    position = np.array([float(f"{place:.6f}") for place in 5e-6 * np.cumsum(steps)])
    assert np.median(np.abs(np.diff(position, 3))) < 1e-17
    assert 5e-7 < white_noise_std(position) < 5e-6


def test_without_a_force_a_tap_has_no_segment_and_a_slide_that_nothing_strikes_is_one_itself() -> None:
    """Samples of the force that were lost are no sign that the part slid from the start on."""
    tap = replace(TAPS[0].capture(force_hz=1e5), force=None)
    segment = extract(tap).segment
    assert isinstance(segment, CaptureError)
    assert str(segment) == "no force was recorded"
    whole = extract(TAPS[0].capture(force_hz=1e5))
    separation, position = required(whole.separation).value, tap.position
    assert position is not None
    slides = position.time_s > separation
    alone = Channel(position.time_s[slides] - separation, position.values[slides], position.noise_std)
    slide = extract(replace(tap, position=alone, velocity_m_s=math.nan))
    distance = required(slide.segment).distance_m
    assert distance[-1] == pytest.approx(required(whole.segment).distance_m[-1], rel=0.01)
