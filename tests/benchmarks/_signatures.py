"""Friction along the stroke: its error, and the speed of the in-cycle filter."""

import math
import time

import numpy as np
from filterpy.kalman import KalmanFilter

from impactcell.features import extract
from impactcell.tracking.signature import in_cycle_filter, tracker
from tests.benchmarks import _deviant
from tests.benchmarks._slides import FRICTION, slide
from tests.benchmarks.table import Table

NOISE = 0.42e-6
SPEED = 0.09


def error_table(*, quick: bool) -> Table:
    """Relative error on bumps of 10 %, width (one sd, as in friction_patch) 0.4-0.8 mm, narrower beside."""
    settings = tracker.SignatureSettings()
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
            signature = tracker.update(settings, tracker.initial_state(settings), extract(capture)).signature
            use = (grid > 0.1 * distance) & (grid < 0.9 * distance)
            off = (signature.friction - friction(grid))[use]
            each.setdefault(width, []).append((off**2).mean())
            if width < 0.4e-3:
                continue
            squares.append((off**2).mean())
            scores.append(((off / signature.friction_std[use]) ** 2).mean())
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


def power_table(*, quick: bool) -> list[Table]:
    """False alarms of deviant cycles, and the power against them."""
    return [
        make(quick=quick) for make in (_deviant.false_alarm_table, _deviant.mixed_table, _deviant.power_table)
    ]


def speed_table(*, quick: bool) -> Table:
    n, rate = 400_000 if quick else 1_000_000, 1e6
    T = 1.0 / rate
    z = 0.1 * np.arange(n) * T + NOISE * np.random.default_rng(1).normal(size=n)
    start = in_cycle_filter.initial_state(T, NOISE, 1e5)
    in_cycle_filter.update(start, z[:10])
    best = math.inf
    for _ in range(7):
        state, before = start, time.perf_counter()
        for block in np.split(z, n // 10_000):
            state, ours = in_cycle_filter.update(state, block)
        best = min(best, time.perf_counter() - before)
    few = 5_000
    oracle = KalmanFilter(3, 1)
    oracle.F = np.array([[1.0, T, T * T / 2.0], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    oracle.H = np.array([[1.0, 0.0, 0.0]])
    oracle.Q, oracle.x = in_cycle_filter.process_noise(T, 1e5), np.zeros((3, 1))
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
    _, ours = in_cycle_filter.update(start, z[:few])
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
