"""Friction along the stroke: its error, power against deviant cycles, speed of the in-cycle filter."""

import math
import time

import numpy as np
from filterpy.kalman import KalmanFilter
from scipy.stats import norm

from impactcell.tracking import incycle, profile, signature
from impactcell.tracking.slide import find_slide
from tests.benchmarks._slides import FRICTION, GRAVITY, slide
from tests.benchmarks.table import Table

NOISE = 0.42e-6
SPEED = 0.09


def error_table(*, quick: bool) -> Table:
    """Relative error on bumps of 10 %, width (one sd, as in friction_patch) 0.4-0.8 mm, narrower beside."""
    settings = signature.SignatureSettings()
    grid = settings.grid_m
    rows = []
    for rate, bar in ((1e3, "<= 1 %"), (1e4, ""), (1e5, "<= 0.3 %")):
        squares, scores, each = [], [], {}
        for k in range(30 if quick else 120):
            rng = np.random.default_rng([7, k])
            width, centre = (0.4e-3, 0.6e-3, 0.8e-3, 0.17e-3)[k % 4], rng.uniform(0.6e-3, 1.4e-3)
            height = 0.1 * rng.choice([-1.0, 1.0])

            def friction(x, c=centre, w=width, h=height):
                return FRICTION * (1.0 + h * np.exp(-0.5 * ((x - c) / w) ** 2))

            capture, distance = slide(friction, SPEED, rate, NOISE, k)
            found = signature.update(settings, signature.initial_state(settings), capture).signature
            use = (grid > 0.1 * distance) & (grid < 0.9 * distance)
            off = (found.friction - friction(grid))[use]
            each.setdefault(width, []).append((off**2).mean())
            if width < 0.4e-3:
                continue
            squares.append((off**2).mean())
            scores.append(((off / found.friction_std[use]) ** 2).mean())
        rmse = 100.0 * math.sqrt(np.mean(squares)) / FRICTION
        error = (
            100.0 * np.std(squares) / math.sqrt(len(squares)) / (2.0 * math.sqrt(np.mean(squares))) / FRICTION
        )
        widths = ", ".join(
            f"{w * 1e3:g}: {100 * math.sqrt(np.mean(s)) / FRICTION:.2f}" for w, s in each.items()
        )
        rows.append(
            [
                f"RMSE at {rate / 1e3:g} kHz",
                bar,
                f"{rmse:.2f} %",
                f"± {1.96 * error:.2f} %",
                widths,
                f"{np.mean(scores):.2f}",
            ]
        )
    note = (
        "Bumps of ± 10 %, width as one sd (0.17 mm: 0.4 mm full width at half height, beside the bar), "
        "noise 0.42 µm, 2.1 mm slides, inner 80 %, each capture on its own, without a reference."
    )
    columns = ["what", "bar", "measured", "95 %", "by width (mm: %)", "mean squared score"]
    return Table("Friction along the stroke", columns, rows, note)


def _normal(rng: np.random.Generator):
    """A normal cycle: texture, and level, tilt and curvature that vary from cycle to cycle."""
    a, b, c = 0.005 * rng.normal(size=3) * (2.0, 1.0, 1.0)

    def friction(x):
        shape = a + b * (x / 1e-3 - 1.0) + c * np.cos(np.pi * x / 2e-3)
        return FRICTION * (1.0 + 0.03 * np.sin(2.0 * np.pi * x / 1.3e-3) + shape)

    return friction


MODES = (
    lambda x: 0.01 * np.ones_like(x),
    lambda x: 0.005 * (x / 1e-3 - 1.0),
    lambda x: 0.005 * np.cos(np.pi * x / 2e-3),
)
DEVIATIONS = {
    "bump": lambda x: np.exp(-0.5 * ((x - 0.9e-3) / 0.25e-3) ** 2),
    "level": np.ones_like,
    "tilt": lambda x: x / 1e-3 - 1.0,
    "ripple": lambda x: np.sin(2.0 * np.pi * x / 0.7e-3 + 0.4),
}


def power_table(*, quick: bool) -> Table:
    """Power at one false alarm in 100000 cycles, the oracle knowing the shape and how cycles vary."""
    settings = signature.SignatureSettings()
    grid = settings.grid_m
    state = signature.initial_state(settings)
    learned = 150 if quick else 400
    false = judged = 0
    for k in range(learned):
        rng = np.random.default_rng([8, k])
        capture, _ = slide(_normal(rng), SPEED, 1e4, NOISE, k)
        done = signature.update(settings, state, capture)
        false += done.deviation is not None
        judged += done.judged
        state = done.state
    rows = [["false alarms", "1e-5 a cycle", f"{false} of {judged}", "", "", ""]]
    to_coefficients = np.linalg.pinv(profile.on_grid(settings.points))
    alpha = 1.0 / settings.false_alarm_cycles
    for name, shape in DEVIATIONS.items():
        # the oracle: known shape, known variation, known sensor noise
        capture, _ = slide(_normal(np.random.default_rng([8, 0])), SPEED, 1e4, NOISE, 0)
        seen = profile.information(find_slide(capture), grid, GRAVITY)
        C = to_coefficients @ (FRICTION * np.array([m(grid) for m in MODES]).T)
        P = seen.matrix - seen.matrix @ C @ np.linalg.solve(
            np.eye(3) + C.T @ seen.matrix @ C, C.T @ seen.matrix
        )
        s = to_coefficients @ (FRICTION * shape(grid))
        unit = math.sqrt(s @ P @ s)
        cells = []
        for oracle in (0.5, 0.9, 0.99):
            amplitude = (norm.isf(alpha) + norm.ppf(oracle)) / unit
            runs = 60 if quick else 200
            hits = 0
            for k in range(runs):
                rng = np.random.default_rng([9, k])
                base, sign = _normal(rng), rng.choice([-1.0, 1.0])
                capture, _ = slide(
                    lambda x, b=base, a=amplitude * sign, s=shape: b(x) + a * FRICTION * s(np.asarray(x)),
                    SPEED,
                    1e4,
                    NOISE,
                    5000 + k,
                )
                hits += signature.update(settings, state, capture).deviation is not None
            cells.append(f"{oracle - hits / runs:+.2f} ({100 * amplitude:.1f} %)")
        rows.append(
            [
                f"{name}: oracle's power minus ours",
                "<= 0.1",
                cells[2],
                f"± {1.96 * math.sqrt(0.09 / runs):.2f}",
                *cells[:2],
            ]
        )
    columns = ["what", "bar", "oracle at 0.99", "95 %", "oracle at 0.5", "oracle at 0.9"]
    note = (
        f"Reference of {learned} cycles; in brackets the amplitude at which the oracle has that power. "
        "Not knowing shape and place costs a search over all of them, most where the oracle itself is unsure."
    )
    return Table("Deviant cycle at 1e-5 false alarms", columns, rows, note)


def speed_table(*, quick: bool) -> Table:
    n, rate = 400_000 if quick else 1_000_000, 1e6
    T = 1.0 / rate
    z = 0.1 * np.arange(n) * T + NOISE * np.random.default_rng(1).normal(size=n)
    start = incycle.start(T, NOISE, 1e5)
    incycle.filter_block(start, z[:10])
    best = math.inf
    for _ in range(7):
        state, before = start, time.perf_counter()
        for block in np.split(z, n // 10_000):
            state, ours = incycle.filter_block(state, block)
        best = min(best, time.perf_counter() - before)
    few = 5_000
    oracle = KalmanFilter(3, 1)
    oracle.F = np.array([[1.0, T, T * T / 2.0], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    oracle.H = np.array([[1.0, 0.0, 0.0]])
    oracle.Q, oracle.x = incycle.process_noise(T, 1e5), np.zeros((3, 1))
    oracle.R *= NOISE**2
    oracle.P = np.diag([100.0 * NOISE**2, 1.0, 100.0])
    theirs, slowest = np.empty((few, 3)), math.inf
    for _ in range(2):
        oracle.x, oracle.P = np.zeros((3, 1)), np.diag([100.0 * NOISE**2, 1.0, 100.0])
        before = time.perf_counter()
        for k in range(few):
            oracle.predict()
            oracle.update(z[k])
            theirs[k] = oracle.x[:, 0]
        slowest = min(slowest, time.perf_counter() - before)
    _, ours = incycle.filter_block(start, z[:few])
    apart = float((np.abs(ours - theirs).max(axis=0) / np.abs(theirs).max(axis=0)).max())
    ratio = (n / best) / (few / slowest)
    rows = [
        [
            "samples/s over filterpy's",
            ">= 1000",
            f"{ratio:.0f}",
            f"{n / best / 1e6:.0f}e6 / {few / slowest:.0f}",
        ],
        ["difference from filterpy", "<= 1e-9", f"{apart:.1e}", "relative, largest"],
        ["share of a core at 1 MHz", "< 2 %", f"{100 * best / (n * T):.2f} %", "blocks of 10000"],
    ]
    return Table("In-cycle filter", ["what", "bar", "measured", ""], rows, "Best of several runs of each.")
