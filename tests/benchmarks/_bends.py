"""Wear that changes its rate, without any batch, and a step in steady wear; through the public `track`."""

import math
from collections.abc import Callable

import numpy as np

import impactcell
from tests.benchmarks import _charts, _steps, _streams
from tests.benchmarks.table import Table

UNIT, MEAN = 0.002, 0.2  # of a series in mu_s
SEEDS = _streams.REPORTED + 190_000
STREAMS, CYCLES = 20, 1500
HALF = CYCLES // 2
TIME = np.arange(CYCLES)
STEPPED, STEP_AT, LONGEST = 40, 800, 800  # streams with a step, its cycle, cycles it is given

Level = Callable[[np.ndarray], np.ndarray]


def run_in(size: float, time: float) -> Level:
    return lambda t: -size * (1.0 - np.exp(-t / time))


def bent(before: float, after: float, begin: int = HALF) -> Level:
    return lambda t: before * np.minimum(t, begin) + after * np.maximum(t - begin, 0)


def slowing(rate: float, begin: int, time: float) -> Level:
    return lambda t: rate * (np.minimum(t, begin) + time * -np.expm1(-np.maximum(t - begin, 0) / time))


KINDS: dict[str, Level] = {
    "steady": bent(0.002, 0.002),
    **{
        f"runs in by {size:g} sd, {time:g} cycles": run_in(size, time)
        for size in (2.0, 5.0, 15.0, 40.0)
        for time in (50.0, 200.0, 600.0)
    },
    "0.2 sd a cycle ends at cycle 150": bent(0.2, 0.0, 150),
    "0.2 sd a cycle until 150, slows down over 100": slowing(0.2, 150, 100.0),
    "0.01 sd a cycle ends half way": bent(0.01, 0.0),
    "0.01 sd a cycle halves half way": bent(0.01, 0.005),
    "0.005 sd a cycle, three times half way": bent(0.005, 0.015),
    "0.002 sd a cycle, five times half way": bent(0.002, 0.01),
    "none, 0.005 sd a cycle from half way on": bent(0.0, 0.005),
    "0.002 sd a cycle, grows e-fold in 500": lambda t: np.expm1(t / 500.0),
}
RATES = (0.0, 3.3e-4, 2e-3, 5e-3, 2e-2)
SIZES = (0.5, 1.0, 2.0, 3.0)


def tracked(values: np.ndarray) -> impactcell.TrackedSeries:
    return impactcell.track(np.arange(len(values)), MEAN + UNIT * values, np.full(len(values), UNIT))


def shifts(series: impactcell.TrackedSeries) -> np.ndarray:
    return np.array([alarm.cycle for alarm in series.alarms if alarm.alarm == "BatchShift"])


def table(*, quick: bool) -> Table:
    runs, rows = 1 if quick else STREAMS, []
    for number, (name, level) in enumerate(KINDS.items()):
        found, told, off = [], 0, []
        truth = level(TIME)
        for seed in range(runs):
            values = truth + np.random.default_rng([SEEDS + seed, number]).normal(size=CYCLES)
            series = tracked(values)
            found.append(len(shifts(series)))
            told += any(" in 1000 cycles, " in note for _, note in series.notes)
            wear = series.wear
            off.append(
                (
                    (wear.rate_per_cycle - UNIT * (truth[-1] - truth[-2])) / wear.rate_std,
                    (wear.level - MEAN - UNIT * truth[-1]) / wear.level_std,
                )
            )
        rate, height = np.sqrt(np.mean(np.square(off), axis=0))
        with_one = sum(count > 0 for count in found)
        rows.append([name, f"{sum(found)} in {with_one}", str(told), f"{rate:.1f}", f"{height:.1f}"])
    return Table(
        "Wear that changes its rate, batch unknown, without any batch",
        [
            "wear beside white scatter",
            f"false batch alarms, in how many of {runs}",
            "another rate told",
            "rate at the end, rms of its distance over its std",
            "level at the end",
        ],
        rows,
        f"{runs} streams of {CYCLES} cycles a row, designed: {1e-5 * runs * CYCLES:.1f} false alarms. What "
        "is taken for a step of the batch is missing in the level.",
    )


def step_table(*, quick: bool) -> Table:
    runs, rows = 2 if quick else STEPPED, []
    cycles = STEP_AT + LONGEST
    for rate in RATES:
        cells = []
        for size in SIZES:
            bound, delays = _charts.optimal_delay(size, _steps.DESIGN), []
            for seed in range(runs):
                draw = np.random.default_rng([SEEDS + 1000 + seed, round(1e6 * rate), round(10 * size)])
                values = rate * np.arange(cycles) + draw.normal(size=cycles)
                values[STEP_AT:] += size * draw.choice([-1.0, 1.0])
                found = shifts(tracked(values))
                after = found[found >= STEP_AT]
                delays.append(float(after[0] - STEP_AT + 1) if len(after) else float(LONGEST))
            error = 1.96 * np.std(delays) / bound / math.sqrt(runs)
            lost = sum(delay == LONGEST for delay in delays)
            cells.append(f"{np.mean(delays) / bound:.2f} ± {error:.2f}, {lost} not found")
        rows.append([f"{rate:g}", *cells])
    return Table(
        "A step in steady wear, batch unknown: delay over the bound",
        ["wear, sd a cycle", *(f"{size:g} sd" for size in SIZES)],
        rows,
        f"{runs} streams with a step at cycle {STEP_AT}, which has {LONGEST} cycles to be found and counts "
        "with them if it is not. The bound knows wear and level (Moustakides 1986).",
    )


if __name__ == "__main__":
    print("\n".join(part(quick=False).markdown() for part in (table, step_table)))
