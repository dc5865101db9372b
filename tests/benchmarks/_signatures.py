"""Friction along the stroke: its error, and its false alarms."""

import math

import numpy as np

from impactcell.features import extract
from impactcell.tracking.signature import tracker
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
