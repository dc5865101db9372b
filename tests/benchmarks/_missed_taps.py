"""Taps that the model misses: what an estimate costs, whether it settles, and how far off it is.

`python -m tests.benchmarks._missed_taps`, about a minute: taps of the simulator's own plant with an effect
that the model of the cell does not know, at shares of the effect's default strength, 2000 to 6000 mm/min, in
both directions; masses, velocities and scales as told.
"""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from impactcell.features import extract
from impactcell.physics import Plant
from impactcell.prediction import Model, Prior, estimate_from_features
from impactcell.records import Estimator, Quality, as_recorded
from tests.benchmarks.table import Table
from tests.discrepancy.study import strengths
from tests.taps import VISCOUS, Tap

SEED = 480_001
"""Nothing was chosen on it."""
MODEL = Model("of the cell", Plant(6.5e5, 465.0, 0.2, 0.152, effects=VISCOUS), Prior(6500.0, 9.3, 0.0228))
EFFECTS = (
    "stribeck_friction", "quadratic_drag", "hertz_contact", "friction_patch", "restoring_force",
    "surface_tilt", "presliding_compliance", "position_sensor_lag", "periodic_friction", "stiction_ageing",
)  # fmt: skip
SHARES = (0.0, 0.1, 0.3, 1.0)
TAPS = 8
"""Of each effect and share."""
FAR_STD = 3.0
"""Standard deviations from which on mu_s is off."""


def _taps(share: float, draw: np.random.Generator) -> Iterator[Tap]:
    for effect in EFFECTS:
        hidden: dict[str, Any] = {effect: strengths(effect, share)} if share else {}
        for _ in range(TAPS):
            yield Tap(
                float(draw.uniform(2000.0, 6000.0)) / 6e4,
                0.2 * (1.0 + 0.1 * float(draw.uniform(-1.0, 1.0))),
                stroke_m=1.5e-3,
                direction=int(draw.choice([1, -1])),
                effects=VISCOUS | hidden,
            )


def _row(share: float, draw: np.random.Generator) -> list[str]:
    times, gaps, pulls, by_waveform, good = [], [], [], 0, 0
    for tap in _taps(share, draw):
        features = extract(as_recorded(tap.capture(draw, 1e5)))
        started = time.process_time()
        found = estimate_from_features(features, MODEL)
        times.append(1e3 * (time.process_time() - started))
        gaps.append(found.gap)
        by_waveform += found.estimator is Estimator.WAVEFORM
        good += found.mu_s.quality is Quality.GOOD
        pulls.append((found.mu_s.value - tap.mu_s) / found.mu_s.std)
    count, far = len(times), np.abs(pulls) > FAR_STD
    return [
        f"{share:g}",
        str(count),
        f"{np.nanmedian(gaps):.2f}",
        f"{np.median(times):.1f} ms",
        f"{np.max(times):.1f} ms",
        f"{by_waveform}",
        f"{good}",
        f"{int(far.sum())}",
    ]


def table() -> Table:
    """One row for each share of the effects' default strengths."""
    draw = np.random.default_rng(SEED)
    _row(SHARES[-1], np.random.default_rng(1))  # compiles
    return Table(
        "Taps that the model misses",
        (
            "strength",
            "taps",
            "gap",
            "CPU, median",
            "largest",
            "by waveform",
            "good",
            f"off by {FAR_STD:g} std",
        ),
        [_row(share, draw) for share in SHARES],
        f"{len(EFFECTS)} effects in turn, at shares of their default strength; the model knows viscous "
        "friction alone. What is not by waveform is by equations, and uncertain.",
    )


if __name__ == "__main__":
    print(table().markdown())
