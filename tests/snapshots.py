"""Captures and snapshots for tests that need one to carry about, not to compute with."""

import math

import numpy as np

from impactcell.alarms import NAMES
from impactcell.records import (
    Alarm,
    BatchState,
    Capture,
    Channel,
    Coefficient,
    Estimator,
    FrictionEstimate,
    PositioningState,
    Quality,
    Signature,
    Snapshot,
    WearState,
    uniform_times,
)


def make_capture(cycle: int = 1, session: int = 1, samples: int = 200, time_ns: int = 10**18) -> Capture:
    rng = np.random.default_rng(cycle)
    force = Channel(
        uniform_times(0.0, 1e4, samples),
        np.rint(rng.normal(100.0, 40.0, samples) / 0.02) * 0.02,
        noise_std=0.4,
        full_scale=(-500.0, 500.0),
        resolution=0.02,
    )
    position = Channel(
        uniform_times(1e-4, 1e4, samples),
        np.rint(np.linspace(0, 1e-3, samples) / 5e-7) * 5e-7,
        resolution=5e-7,
    )
    return Capture(
        cycle=cycle,
        session=session,
        velocity_m_s=0.05,
        mass_kg=18.9,
        force=force,
        position=position,
        time_ns=time_ns + cycle * 10**9,
        batch_id="A",
    )


def make_snapshot(capture: Capture, mu_s: float = 0.2, alarms: tuple[Alarm, ...] = ()) -> Snapshot:
    good = Coefficient(mu_s, 0.002, Quality.GOOD)
    none = Coefficient(reason="not estimated")
    grid = np.linspace(0.0, 3e-3, 30)
    return Snapshot(
        cycle=capture.cycle,
        time_ns=capture.time_ns,
        velocity_m_s=capture.velocity_m_s,
        mass_kg=capture.mass_kg,
        friction=FrictionEstimate(good, good, good, none, good, Estimator.COMBINED, 150.0, 4e-4, 1.0),
        wear=WearState(mu_s, 0.001, 1e-6, 1e-7, 0.25, 0.01, math.inf, 5e4, math.inf, Quality.GOOD),
        batch=BatchState("A", 0.0, 0.001, 0.0, math.nan, 0, Quality.GOOD),
        signature=Signature(grid, np.full(30, 0.15), np.full(30, 1e-3), 2.0, 3.0, math.nan, Quality.GOOD),
        positioning=PositioningState(),
        alarms=alarms or tuple(Alarm(name) for name in NAMES),
        model_name="prototype",
        gap=1.0,
        gap_quality=Quality.GOOD,
    )
