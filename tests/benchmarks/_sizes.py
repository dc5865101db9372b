"""Size of a deviation beside the true one: how far off it is, in its own standard deviations."""

import math
from dataclasses import replace

import numpy as np

from impactcell.features import extract, required
from impactcell.tracking.signature import deviation_test, friction_profile, matched_filter_scan, tracker
from tests.benchmarks._deviant import NOISE, RATE, SPEED, Normality, _normal
from tests.benchmarks._slides import FRICTION, GRAVITY, slide
from tests.benchmarks.table import Table

LEARNED = 400
SCORES = (4.0, 60.0)
LARGEST = 0.45  # of the friction


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _bump(profile):
    """Anywhere in the slide, of one profile over the distance in widths."""

    def make(rng):
        place, width = rng.uniform(0.2e-3, 1.85e-3), _log_uniform(rng, 0.2e-3, 0.7e-3)
        return lambda x: profile((x - place) / width)

    return make


def _ripple(rng):
    wave, phase = _log_uniform(rng, 0.45e-3, 2e-3), rng.uniform(0.0, 2.0 * math.pi)
    return lambda x: np.sin(2.0 * np.pi * x / wave + phase)


# all as high as one, and as wide at half of their height as a bell is
SHAPES = {
    "bump, a bell": ("bump", _bump(lambda x: np.exp(-0.5 * x**2))),
    "bump, a cosine window": (
        "bump",
        _bump(lambda x: np.where(np.abs(x) < 2.355, 0.5 + 0.5 * np.cos(np.pi * x / 2.355), 0.0)),
    ),
    "bump, a box": ("bump", _bump(lambda x: 0.5 * (np.tanh((x + 1.18) / 0.15) - np.tanh((x - 1.18) / 0.15)))),
    "ripple": ("ripple", _ripple),
    "level": ("level", lambda _: np.ones_like),
    "tilt": ("tilt", lambda _: lambda x: (x - 1e-3) / 4e-3),
}


def table(*, quick: bool) -> Table:
    """Error over standard deviation of what is reported, that is of detected cycles only."""
    settings = tracker.SignatureSettings()
    truth, alpha = Normality(settings), 1.0 / settings.false_alarm_cycles
    state = tracker.initial_state(settings)
    for vector in truth.vectors(np.random.default_rng(13), LEARNED) + truth.G @ truth.mean:
        seen = replace(truth.seen, vector=vector)
        state = tracker.update_reference(state, seen, settings, None)
    rows = []
    for number, (name, (family, make)) in enumerate(SHAPES.items()):
        found, deviant = [], 0
        runs = 60 if quick else 400
        for k in range(runs):
            rng = np.random.default_rng([14, number, k])
            base, sign, shape = _normal(rng), rng.choice([-1.0, 1.0]), make(rng)
            size = min(_log_uniform(rng, *SCORES) / truth.score(shape, truth.G), LARGEST) * sign * FRICTION

            def friction(x, base=base, size=size, shape=shape):
                return base(x) + size * shape(np.asarray(x))

            capture, _ = slide(friction, SPEED, RATE, NOISE, 20_000 + k)
            verdict = deviation_test.test_deviation(
                state.reference,
                friction_profile.information(required(extract(capture).segment), truth.grid, GRAVITY),
                truth.grid,
            )
            deviant += verdict.p_value < alpha
            if verdict.p_value < alpha and verdict.kind == family:
                true = abs(size) if family == "ripple" else size
                found.append(
                    ((verdict.size - true) / verdict.size_std * np.sign(true), verdict.size / true - 1.0)
                )
        off, relative = np.array(found).T
        low, high = np.percentile(off, (15.87, 84.13))
        rows.append(
            [
                name,
                "" if name.endswith("box") else "0.8 .. 1.25",
                f"{off.std():.2f}",
                f"{(high - low) / 2.0:.2f}",
                f"{off.mean():+.2f}",
                f"{100 * (np.abs(off) < 2.0).mean():.0f} %",
                f"{100 * np.median(np.abs(relative)):.0f} %",
                f"{len(off)} of {deviant} of {runs}",
            ]
        )
    columns = ["error over std", "bar", "std", "half of the middle 68 %", "mean", "within 2"]
    columns += ["median error over size", "of the family, of deviant, of all"]
    note = (
        f"Reference of {LEARNED} cycles. Amplitudes such that the oracle's score is {SCORES[0]:g} to "
        f"{SCORES[1]:g}, log-uniform, at most {100 * LARGEST:g} % of the friction; bumps 0.2 to 1.85 mm from "
        "the start, 0.47 to 1.65 mm wide at half of their height, ripples of 0.45 to 2 mm at any phase. Only "
        f"deviant cycles are sized, and only those told as the right one of "
        f"{', '.join(matched_filter_scan.FAMILIES)} can be compared. A mean above zero "
        "is a size told too large."
    )
    return Table("Size of a deviation", columns, rows, note)
