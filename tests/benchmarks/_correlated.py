"""Scatter that is correlated from cycle to cycle, through the public `track`, batch unknown."""

import itertools
import math

import numpy as np
from scipy.stats import poisson

import impactcell
from tests.benchmarks import _charts, _steps, _streams
from tests.benchmarks.table import Table

UNIT, MEAN = 0.002, 0.2  # of a series in mu_s
SEEDS = _streams.REPORTED + 150_000
CORRELATIONS = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7)
QUIET, QUIET_CYCLES = 40, 2500  # streams without a step, and their cycles
STEPPED, STEPPED_CYCLES, STEP = 60, 2000, 2.0  # streams with one in their middle, of so many sd


def scatter(correlation: float, cycles: int, seed: int) -> np.ndarray:
    """x_t = a x_(t-1) + e_t with variance one, from its stationary distribution."""
    draw = np.random.default_rng([seed, round(100 * correlation)])
    innovations = math.sqrt(1.0 - correlation**2) * draw.normal(size=cycles)
    innovations[0] = draw.normal()
    return np.array([*itertools.accumulate(innovations, lambda x, e: correlation * x + e)])


def shifts(values: np.ndarray) -> tuple[np.ndarray, float]:
    """Cycles of the batch alarms, and how many of its std the rate at the end is off."""
    worn = values + _streams.SLOPE * np.arange(len(values))
    series = impactcell.track(np.arange(len(worn)), MEAN + UNIT * worn, np.full(len(worn), UNIT))
    found = np.array([alarm.cycle for alarm in series.alarms if alarm.alarm == "BatchShift"])
    return found, (series.wear.rate_per_cycle - UNIT * _streams.SLOPE) / series.wear.rate_std


def table(*, quick: bool) -> Table:
    rows = [_row(correlation, quick=quick) for correlation in CORRELATIONS]
    note = (
        f"{QUIET} streams of {QUIET_CYCLES} cycles without a step, their first cycles with them, and "
        f"{STEPPED} of {STEPPED_CYCLES} with one of {STEP:g} sd in the middle; wear in all. The bound is of "
        "white scatter with the same variance of a mean of many: sd times the root of (1 + a) / (1 - a). "
        f"Designed is one false alarm in {_steps.DESIGN:.0f} cycles. Beyond 0.9 it is a level that walks."
    )
    columns = [
        "correlation of successive estimates, a",
        "false batch alarms per 100 000 cycles",
        "at the design, p",
        f"delay of {STEP:g} sd, mean, over its bound, 95 %",
        "median delay",
        "not found in 1000 cycles",
        "wear rate, rms of error over its std",
    ]
    return Table("Scatter correlated from cycle to cycle, batch unknown", columns, rows, note)


def _row(correlation: float, *, quick: bool) -> list[str]:
    share = 10 if quick else 1
    quiet = [shifts(scatter(correlation, QUIET_CYCLES, SEEDS + i)) for i in range(QUIET // share)]
    false, cycles = sum(len(found) for found, _ in quiet), len(quiet) * QUIET_CYCLES
    begin, waits = STEPPED_CYCLES // 2, []
    for i in range(STEPPED // share):
        values = scatter(correlation, STEPPED_CYCLES, SEEDS + 1000 + i)
        values[begin:] += STEP
        found, _ = shifts(values)
        waits.append(min(found[found >= begin], default=math.inf) - begin + 1)
    delays = np.minimum(waits, STEPPED_CYCLES - begin)
    delay, error = float(delays.mean()), 1.96 * float(delays.std()) / math.sqrt(len(delays))
    bound = _charts.optimal_delay(STEP * math.sqrt((1.0 - correlation) / (1.0 + correlation)), _steps.DESIGN)
    rms = math.sqrt(float(np.mean([off**2 for _, off in quiet])))
    return [
        f"{correlation:g}",
        f"{1e5 * false / cycles:.1f} ({false})",
        f"{poisson.sf(false - 1, cycles / _steps.DESIGN):.2g}",
        f"{delay:.1f}, {delay / bound:.2f} ± {error / bound:.2f}",
        f"{np.median(delays):.1f}",
        f"{sum(math.isinf(wait) for wait in waits)} of {len(waits)}",
        f"{rms:.2f}",
    ]
