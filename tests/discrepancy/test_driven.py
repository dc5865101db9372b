"""Driven records: blocks, what the noise of the drive does, and the workflow on the simulator's own plant."""

from dataclasses import replace

import numpy as np
import pytest

from impactcell.discrepancy.data.campaign_checks import check_campaign_units
from impactcell.discrepancy.data.driven_blocks import cut_blocks, smoothed_velocity
from impactcell.discrepancy.data.measured_drive import (
    SmoothedDrive,
    mass_from_momentum,
    position_response,
    smooth_drive,
)
from impactcell.discrepancy.data.prepared_campaign import prepare, shot_set
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.workflow import investigate
from impactcell.errors import CampaignError
from tests.benchmarks._discrepancy_driven import LISTED, Job, record

pytestmark = pytest.mark.slow

FEW = ("viscous_friction", "quadratic_drag", "surface_tilt", "force_sensor_offset")


def test_noise_integrated_twice() -> None:
    # A free mass under white noise of density S: the variance of its position is S t^3 / 3 m^2.
    mass, density = 3.0, 2e-4
    drive = SmoothedDrive(np.linspace(0.0, 0.5, 101), np.full(101, 50.0), density)
    h = 0.005
    G = position_response(drive, np.full(101, 0.2), mass, 5.0)
    # The knots are averages of white noise over h but for what neighbours share.
    variance = density / h * (G**2).sum(axis=1)
    np.testing.assert_allclose(variance[20:], density * drive.time_s[20:] ** 3 / 3.0 / mass**2, rtol=0.1)


def test_a_stop_forgets_the_speed_and_keeps_the_place() -> None:
    time = np.linspace(0.0, 0.5, 101)
    drive = SmoothedDrive(time, np.full(101, 1.0), 1e-4)
    speed = np.where(time < 0.2, 0.2, 0.0)
    G = position_response(drive, speed, 3.0, 5.0)
    early = np.flatnonzero(time < 0.1)
    assert (np.abs(G[-1, early]) > 0.0).all()
    np.testing.assert_allclose(G[-1], G[50], atol=1e-18)
    assert not G[:, time > 0.25].any()


@pytest.mark.parametrize("tau", [0.0, 1e-3])
def test_density_of_white_and_coloured_noise(tau: float) -> None:
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 2.0, 2e-4)
    noise = 0.3 * rng.standard_normal(len(time))
    expected = 0.3**2 * 2e-4
    if tau:
        keep = np.exp(-2e-4 / tau)
        for i in range(1, len(noise)):
            noise[i] = keep * noise[i - 1] + np.sqrt(1.0 - keep**2) * noise[i]
        expected *= (1.0 + keep) / (1.0 - keep)
    force = 40.0 * np.sin(2.0 * np.pi * 3.0 * time)
    drive = smooth_drive(time, force + noise, float(time[-1]))
    # Where the drive begins to show it is counted as noise: a bound from above, but no loose one.
    assert 0.7 < drive.density / expected < 2.0
    impulse = np.trapezoid(drive.force_n, drive.time_s) - np.trapezoid(force, time)
    assert abs(impulse) < 4.0 * np.sqrt(expected * 2.0)


def test_blocks_begin_where_the_part_is_fast() -> None:
    (capture,) = record(Job("", 7301, coloured=False)).shots
    assert capture.position is not None
    speed = smoothed_velocity(capture.position.time_s, capture.position.values)
    made = cut_blocks((capture,))
    assert len(made) >= 20
    for block, place in made:
        assert place == 1
        assert abs(block.covariates["initial_speed"]) >= 0.25 * np.sqrt(np.mean(speed**2))
        assert block.force is not None
        assert block.position is not None
        assert block.force.time_s[0] <= 0.0
        assert block.force.time_s[-1] >= block.position.time_s[-1]


def test_nothing_is_found_where_nothing_is_hidden() -> None:
    found = investigate(record(Job("", 7302, coloured=True)), library=FEW)
    outcome = result_document(found)
    assert outcome["verdict"] == "no_gap"
    assert outcome["gap"]["held_out"]["before"] == pytest.approx(1.0, abs=0.15)


def test_a_hidden_effect_is_named_with_its_parameter() -> None:
    found = investigate(record(Job("viscous_friction", 7303, coloured=False)), library=FEW)
    outcome = result_document(found)
    assert outcome["verdict"] == "named"
    (effect,) = outcome["effects"]
    assert effect["effect"] == "viscous_friction"
    assert effect["where"]["phase"] == "driven"
    truth = LISTED["viscous_friction"]["viscous_coefficient_n_s_per_m"]
    assert effect["parameters"]["viscous_coefficient_n_s_per_m"]["value"] == pytest.approx(truth, rel=0.05)
    assert outcome["gap"]["held_out"]["after"] < 1.15 < outcome["gap"]["held_out"]["before"]


def test_a_record_too_short_is_told() -> None:
    given = record(Job("", 7302, coloured=True))
    (capture,) = given.shots
    assert capture.force is not None
    assert capture.position is not None
    force, position = (
        replace(channel, time_s=channel.time_s[:800], values=channel.values[:800])
        for channel in (capture.force, capture.position)
    )
    short = replace(capture, force=force, position=position)
    with pytest.raises(CampaignError, match="blocks are too few"):
        investigate(replace(given, shots=(short,)))


def test_the_motion_weighs_the_part() -> None:
    given = record(Job("", 7302, coloured=True))
    (capture,) = given.shots
    assert capture.position is not None
    assert capture.force is not None
    assert mass_from_momentum(capture.position, capture.force) == pytest.approx(capture.mass_kg, rel=0.05)
    heavy = replace(capture, mass_kg=1000.0 * capture.mass_kg)
    for check in (prepare, check_campaign_units):
        with pytest.raises(CampaignError, match="check the units of mass_kg"):
            check(replace(given, shots=(heavy,)))
    check_campaign_units(given)
    unknown = prepare(replace(given, shots=(replace(capture, mass_kg=float("nan")),)))
    assert any("mass of shot 1 is not stated" in note for note in unknown.notes)


def test_whitened_and_back() -> None:
    prepared = prepare(record(Job("", 7302, coloured=True)))
    shots = shot_set(prepared, np.arange(4), (float("nan"), 2e-6, float("nan")))
    change = 1e-5 * np.random.default_rng(6).standard_normal(shots.values.size)
    np.testing.assert_allclose(shots.unwhiten(shots.whiten(change)), change, rtol=0.0, atol=1e-12)
    # One position alone is as uncertain as its sensor at the start of a block, and more so later on.
    spread = np.linalg.inv(shots.items[0].whitener)
    deviation = np.sqrt((spread**2).sum(axis=1))
    assert deviation[0] == pytest.approx(2e-6)
    assert deviation[-1] > 2.0 * deviation[0]
