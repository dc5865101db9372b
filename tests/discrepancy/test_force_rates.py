"""Noise of records whose force has another rate than the position, is held, or is read on a raster."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import NumberPrior, investigate_machine
from impactcell.discrepancy.machine.records.smoothing import test_function as weights_of
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord, uniform_records
from impactcell.discrepancy.machine.search.held_numbers import sampling_step_s
from impactcell.discrepancy.report.machine_result import machine_document
from impactcell.records import Capture, Channel, Samples
from tests.discrepancy.stick_slip import SLIDE, sines, slides

pytestmark = pytest.mark.slow

RATE_HZ = 500.0
NOISE_N, NOISE_M = 0.2, 1e-5


@lru_cache
def exact() -> Campaign:
    """Slides without any noise."""
    return slides(lambda rng: sines(4.0, rng), (0.0, 0.0), rate_hz=RATE_HZ, count=4)


def measured(
    force_hz: float = RATE_HZ, held: int = 1, raster_m: float = 0.0, *, stated: bool = True
) -> Campaign:
    """The same with noise; the force at a rate of its own, or held for some samples."""
    rng = np.random.default_rng(17)
    shots = []
    for shot in exact().shots:
        assert shot.force is not None
        assert shot.position is not None
        time = np.arange(0.0, shot.force.time_s[-1], 1.0 / force_hz)
        force = np.interp(time, shot.force.time_s, shot.force.values) + rng.normal(0.0, NOISE_N, time.size)
        force = np.repeat(force[::held], held)[: time.size]
        noise_m = 2e-6 if raster_m else NOISE_M
        position = shot.position.values + rng.normal(0.0, noise_m, shot.position.values.size)
        if raster_m:
            position = raster_m * np.round(position / raster_m)
        shots.append(
            replace(
                shot,
                force=Channel(time, force, NOISE_N if stated else None),
                position=Channel(
                    shot.position.time_s, position, noise_m if stated else None, resolution=raster_m or None
                ),
            )
        )
    return replace(exact(), shots=tuple(shots))


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("force_hz", [50.0, 100.0, 730.0, 2000.0])
def test_no_gap_is_seen_whatever_the_rate_of_the_force(force_hz: float, *, stated: bool) -> None:
    """At a tenth of the position's its noise was too small by the root of ten: the verdict was unknown.

    Somewhat less than a floor is left: where the part turns, friction counts as uncertain by all of itself.
    """
    finding = investigate_machine(measured(force_hz, stated=stated), SLIDE)
    assert finding.verdict == "no_gap"
    assert 0.7 < finding.train_gaps[0] < 1.2
    assert machine_document(finding)["noise_floor"]["noise_std"][0] == pytest.approx(NOISE_N, rel=0.1)


@pytest.mark.parametrize("stated", [True, False])
def test_a_measured_force_that_is_held_has_the_noise_of_its_updates(*, stated: bool) -> None:
    base = replace(SLIDE, delay_s=NumberPrior(0.0, 0.02))
    finding = investigate_machine(measured(held=10, stated=stated), base)
    assert finding.verdict == "no_gap"
    assert machine_document(finding)["noise_floor"]["noise_std"][0] == pytest.approx(NOISE_N, rel=0.15)


def test_a_raster_is_noise_beside_that_which_is_stated() -> None:
    finding = investigate_machine(measured(raster_m=2e-4), SLIDE)
    assert finding.verdict == "no_gap"
    assert machine_document(finding)["noise_floor"]["noise_std"][1] == pytest.approx(
        math.hypot(2e-6, 2e-4 / math.sqrt(12.0)), rel=1e-3
    )


def record_of(force: Samples, force_hz: float, noise: float | None) -> UniformRecord:
    time = np.arange(0.0, 20.0, 1.0 / RATE_HZ)
    shot = Capture(
        1,
        math.nan,
        1.0,
        Channel(np.arange(len(force)) / force_hz, force, noise),
        Channel(time, np.sin(time), 1e-6),
    )
    [record] = uniform_records(Campaign(Excitation.DRIVEN, (shot,)), replace(SLIDE, inertia=NumberPrior(1.0)))
    return record


@pytest.mark.parametrize(("force_hz", "held"), [(50.0, 1), (125.0, 1), (500.0, 1), (500.0, 8), (250.0, 4)])
def test_noise_of_a_force_is_that_of_its_means_over_test_functions(force_hz: float, held: int) -> None:
    """Truth: the scatter of such means of a record of nothing but noise."""
    rng, half = np.random.default_rng(3), 120
    weight, _ = weights_of(half, 1.0 / RATE_HZ)
    slow = 20.0 * np.sin(0.05 * np.arange(20.0 * force_hz / held))
    quiet = record_of(np.repeat(slow, held), force_hz, 1.0).force
    means = []
    for _ in range(20):
        record = record_of(np.repeat(slow + rng.normal(0.0, 1.0, slow.size), held), force_hz, 1.0)
        left = record.force - quiet
        means += [float(left[begin : begin + len(weight)] @ weight) for begin in range(0, 9000, half)]
    expected = record.noise[1] * float(np.linalg.norm(weight))
    assert float(np.std(means)) == pytest.approx(expected, rel=0.12)
    assert record.sensor_noise[1] == pytest.approx(1.0)
    assert sampling_step_s([record]) == pytest.approx(held / force_hz)
