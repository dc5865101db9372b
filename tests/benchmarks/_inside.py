"""Wear, batches and outliers: the bank alone, told the scale of the noise, beside classical charts."""

import math

import numpy as np

from tests.benchmarks import _charts, _classical, _steps, _streams
from tests.benchmarks.table import Table

SIZES = (0.5, 1.0, 2.0, 3.0)
SEEDS = _streams.REPORTED
STEP_SEEDS = _streams.REPORTED + 10_000


def wear_table(*, quick: bool) -> Table:
    runs = 40 if quick else 200
    errors, false, changes = [], 0, 0
    for seed in range(SEEDS, SEEDS + runs):
        truth = _streams.stream(seed)
        run = _steps.Run.start(truth.values[0])
        found = run.follow(truth.values[1:])
        mean, covariance = run.moments()
        best, best_std = _streams.oracle_slope(truth)
        errors.append((mean[1] - _streams.SLOPE, covariance[1, 1] ** 0.5, best - _streams.SLOPE, best_std))
        false += _streams.false_alarms(found, truth)
        changes += len(truth.changes)
    rows = slope_rows(np.array(errors), "<= 1.4", "")
    rows.append(["false batch alarms per 10000", "<= 0.7", f"{false / runs:.2f}", per_stream(false, runs)])
    note = (
        f"{runs} streams of 10000 cycles, {changes} batch steps; the compiled bank, scale of the noise given."
    )
    name = "The bank alone, batch unknown: wear inside the stream"
    return Table(name, ["what", "bar", "measured", "95 %"], rows, note)


def steps_table(*, quick: bool) -> Table:
    """Delays inside the stream, beside classical charts told wear and level, at the same false alarms."""
    runs = 30 if quick else 1000
    delays: dict[float, list[float]] = {size: [] for size in SIZES}
    later: list[float] = []
    false = 0
    streams = [_streams.stream(STEP_SEEDS + i, sizes=SIZES) for i in range(runs)]
    for truth in streams:
        found = _steps.Run.start(truth.values[0]).follow(truth.values[1:])
        false += _streams.false_alarms(found, truth)
        for i, (size, delay) in enumerate(_streams.first_alarms(found, truth)):
            delays[size].append(delay)
            if i and size == SIZES[0]:
                later.append(delay)
    measured = 1e4 * runs / max(false, 1)
    # compared at the rate that was measured, where that is worse than the design
    arl = min(_steps.DESIGN, measured)
    charts = _classical.delays(streams, arl)
    rows = [["false batch alarms per 10000", "<= 0.7", f"{false / runs:.2f}", per_stream(false, runs)]]
    rows[0] += [f"{1e4 * chart.false / chart.cycles:.2f}" for chart in charts]
    for size in SIZES:
        bound = _charts.optimal_delay(size, arl)
        seen = np.array(delays[size])
        d = seen[np.isfinite(seen)] / bound
        row = [f"delay / bound, steps of {size:g} sd", "<= 1.5", f"{d.mean():.3f}"]
        row.append(f"± {1.96 * d.std() / math.sqrt(len(d)):.3f}")
        rows.append([*row, *(chart.ratio(size, bound) for chart in charts)])
        lost = [f"{100 * (1 - len(d) / len(seen)):.1f} %", f"of {len(seen)}"]
        rows.append(
            [
                f"not found before the next step, {size:g} sd",
                "",
                *lost,
                *(chart.lost(size) for chart in charts),
            ]
        )
    d = np.array(later)[np.isfinite(later)] / _charts.optimal_delay(SIZES[0], arl)
    error = 1.96 * d.std() / math.sqrt(len(d))
    name = f"delay / bound, {SIZES[0]:g} sd, without the first step of each stream"
    rows.append([name, "", f"{d.mean():.3f}", f"± {error:.3f}", *[""] * len(charts)])
    note = (
        f"{runs} streams with steps of 0.5 .. 3 sd; delays of the steps that were found before the next. "
        "The charts are told wear, the level before each step and when each batch began; all but Shewhart "
        f"get values clipped at {_classical.CLIP:g} sd, and all thresholds are set to the same false alarms. "
        "Before the first step the bank has one batch to learn level and wear from, and a small step in it "
        "looks like wear."
    )
    columns = ["what", "bar", "measured", "95 %", *_charts.CHARTS]
    return Table("Batch unknown: steps inside the stream", columns, rows, note)


def per_stream(count: int, runs: int) -> str:
    return f"± {1.96 * math.sqrt(count + 1) / runs:.2f}"


def slope_rows(e: np.ndarray, bar: str, nees_bar: str) -> list[list[str]]:
    """Ratio of root mean square errors, bias and NEES, with bootstrap intervals over streams.

    Columns of `e`: error, its stated standard deviation, the oracle's error.
    """
    rng = np.random.default_rng(0)

    def figures(rows: np.ndarray) -> tuple[float, float, float]:
        ratio = math.sqrt((rows[:, 0] ** 2).mean() / (rows[:, 2] ** 2).mean())
        # the oracle's own error is common to both and is taken out of the bias
        bias = (rows[:, 0] - rows[:, 2]).mean() / _streams.SLOPE
        return ratio, 100.0 * bias, ((rows[:, 0] / rows[:, 1]) ** 2).mean()

    boot = np.array([figures(e[rng.integers(0, len(e), len(e))]) for _ in range(2000)])
    low, high = np.percentile(boot, [2.5, 97.5], axis=0)
    ratio, bias, nees = figures(e)
    return [
        ["slope RMSE / oracle", bar, f"{ratio:.3f}", f"{low[0]:.3f} .. {high[0]:.3f}"],
        [
            "slope bias beyond the oracle's",
            "within 2 %",
            f"{bias:+.2f} %",
            f"{low[1]:+.2f} .. {high[1]:+.2f} %",
        ],
        ["slope NEES", nees_bar, f"{nees:.2f}", f"{low[2]:.2f} .. {high[2]:.2f}"],
    ]
