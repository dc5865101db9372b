"""Streams that the tracker does not assume, through the public `track`, batch unknown, no batch in any.

``python -m tests.benchmarks._other_streams`` prints the rows of heavy tails alone.
"""

import itertools
import math
from collections.abc import Callable

import numpy as np

from tests.benchmarks import _correlated, _streams
from tests.benchmarks.table import Table

SEEDS = _streams.REPORTED + 160_000
STREAMS, CYCLES, YOUNG = 6, 5000, 1500
TAIL_STREAMS, TAIL_SEEDS = 12, 100  # of heavy tails: what is rare in them takes more cycles to count

Make = Callable[[np.random.Generator], np.ndarray]
TIME = np.arange(CYCLES)
HALF = CYCLES // 2


def white(draw: np.random.Generator) -> np.ndarray:
    return draw.normal(size=CYCLES)


def scaled_from_half_way(factor: float) -> Make:
    return lambda draw: white(draw) * np.where(TIME < HALF, 1.0, factor)


def swinging(size: float, period: float) -> Make:
    return lambda draw: white(draw) + size * np.sin(2.0 * np.pi * TIME / period)


def walking(size: float, begin: int) -> Make:
    return lambda draw: white(draw) + size * np.cumsum(white(draw) * (begin <= TIME))


def with_volatility(draw: np.random.Generator) -> np.ndarray:
    """The logarithm of the scatter is autoregressive: 0.2 a cycle, 0.98 of it kept, halved."""
    logarithm = [*itertools.accumulate(0.2 * white(draw), lambda x, e: 0.98 * x + e)]
    return white(draw) * np.exp(0.5 * np.array(logarithm))


def heavy_tails(degrees: int) -> Make:
    return lambda draw: draw.standard_t(degrees, size=CYCLES) / math.sqrt(degrees / (degrees - 2.0))


def moving_average(draw: np.random.Generator) -> np.ndarray:
    e = draw.normal(size=CYCLES + 1)
    return (e[1:] + 0.5 * e[:-1]) / math.sqrt(1.25)


KINDS: dict[str, Make] = {
    "white": white,
    "heavy tails: t with 3 degrees": heavy_tails(3),
    "uniform": lambda draw: draw.uniform(-1.0, 1.0, size=CYCLES) * math.sqrt(3.0),
    "skewed: gamma of order 2": lambda draw: (draw.gamma(2.0, size=CYCLES) - 2.0) / math.sqrt(2.0),
    "rounded to 2 sd": lambda draw: 2.0 * np.round(white(draw) / 2.0),
    "moving average of order 1, 0.5": moving_average,
    "two velocities in turn, 1 sd apart": lambda draw: white(draw) + 0.5 * (-1.0) ** TIME,
    "scatter halves half way": scaled_from_half_way(0.5),
    "scatter grows by a quarter": scaled_from_half_way(1.25),
    "scatter grows by a half": scaled_from_half_way(1.5),
    "scatter doubles": scaled_from_half_way(2.0),
    "scatter whose logarithm walks": with_volatility,
    "running in, 5 sd, 300 cycles": lambda draw: white(draw) + 5.0 * np.exp(-TIME / 300.0),
    "level swings by 1 sd, period 500": swinging(1.0, 500.0),
    "level swings by 1 sd, period 2000": swinging(1.0, 2000.0),
    "level swings by 3 sd, period 2000": swinging(3.0, 2000.0),
    "level walks by 0.02 sd a cycle": walking(0.02, 0),
    "level walks by 0.05 sd a cycle": walking(0.05, 0),
    "the same from half way on": walking(0.05, HALF),
    "heavy tails: t with 4 degrees": heavy_tails(4),
    "heavy tails: t with 5 degrees": heavy_tails(5),
}
TAILS = [name for name in KINDS if name.startswith("heavy tails")]


def row(name: str, *, quick: bool) -> list[str]:
    runs, first = (TAIL_STREAMS, TAIL_SEEDS) if name in TAILS else (STREAMS, 0)
    runs, number = 1 if quick else runs, list(KINDS).index(name)
    done = [
        _correlated.shifts(KINDS[name](np.random.default_rng([SEEDS + first + seed, number])))
        for seed in range(runs)
    ]
    found = np.concatenate([cycles for cycles, _ in done])
    young = int(np.sum(found < YOUNG))
    late = 1e5 * (len(found) - young) / (runs * (CYCLES - YOUNG))
    rms = math.sqrt(float(np.mean([off**2 for _, off in done])))
    return [name, f"{1e5 * len(found) / (runs * CYCLES):.0f} ({len(found)})", f"{late:.0f}", f"{rms:.1f}"]


def table(*, quick: bool) -> Table:
    runs, tail_runs = (1, 1) if quick else (STREAMS, TAIL_STREAMS)
    rows = [row(name, quick=quick) for name in KINDS]
    return Table(
        "Streams of other kinds, batch unknown, without any batch",
        [
            "what differs from white scatter beside wear",
            "false batch alarms per 100 000 cycles",
            f"after the first {YOUNG}",
            "wear rate, rms of its distance from the wear's over its std",
        ],
        rows,
        f"{runs} streams of {CYCLES} cycles a row, {tail_runs} of heavy tails, designed: "
        f"{1e-5 * runs * CYCLES:.1f} and {1e-5 * tail_runs * CYCLES:.1f} false alarms. Where the level "
        "itself moves, the rate has to be that of the moment, not the wear's.",
    )


if __name__ == "__main__":
    for kind in TAILS:
        print("| " + " | ".join(row(kind, quick=False)) + " |", flush=True)
