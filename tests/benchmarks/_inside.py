"""Wear, batches and outliers together: slope, shifts and the wear limit, batch unknown and known."""

import json
import math
from pathlib import Path

import numpy as np

from impactcell.alarms import AlarmSettings
from impactcell.compiled import compiled
from impactcell.records import AlarmName
from impactcell.tracking import BatchKnowledge, Reading, TrackerSettings, bank, initial_state, track
from tests.benchmarks import _charts, _steps, _streams
from tests.benchmarks.table import Table

SIZES = (0.5, 1.0, 2.0, 3.0)
UNIT, MEAN = 0.002, 0.2  # of a series in mu_s
RESULTS = Path("bench-results/tracking-known.jsonl")


@compiled
def _follow(
    z: np.ndarray,
    table: np.ndarray,
    count: int,
    design: np.ndarray,
    limit: float,
    found: np.ndarray,
    level: np.ndarray,
) -> tuple[int, int]:
    """Run the bank over z: indices of alarms to `found`; mean and variance of the level to `level`."""
    reading = np.zeros(6)
    reading[1], reading[2] = 1.0, 1.0
    accepted, alarms_found = table[0, 1], 0
    for t in range(1, len(z)):
        reading[0], reading[4] = z[t], t
        count, _, statistic = bank.run_cycle(table, count, design, reading, accepted)
        if statistic > limit and alarms_found < len(found):
            accepted = t
            found[alarms_found] = t
            alarms_found += 1
        mean = square = inside = 0.0
        for i in range(count):
            share = math.exp(table[i, 0])
            own = table[i, 2] - table[i, 4]
            mean += share * own
            square += share * own**2
            inside += share * (table[i, 6] - 2.0 * table[i, 8] + table[i, 16])
        level[t, 0], level[t, 1] = mean, inside + square - mean**2
    return count, alarms_found


def crossings(seed: int, level: np.ndarray, rules: AlarmSettings) -> tuple[int, bool]:
    """Activations of the wear alarm around one true crossing, and whether the first was too early."""
    where = float(np.random.default_rng([5, seed]).uniform(0.8, 2.8))
    true = where / _streams.SLOPE
    probability = 0.5 * np.array([math.erfc((where - m) / math.sqrt(2.0 * max(v, 1e-12))) for m, v in level])
    on, missed, activations, first = False, 0, 0, None
    off_delay = rules.rule(AlarmName.WEAR_LIMIT).off_delay
    for t, p in enumerate(probability):
        if not on and p > rules.wear_on:
            on, missed = True, 0
            activations += 1
            first = t if first is None else first
        elif on:
            missed = missed + 1 if p <= rules.wear_off else 0
            on = missed <= off_delay
    return activations, first is not None and first < true


def unknown_table(*, quick: bool) -> list[Table]:
    runs = 40 if quick else 200
    limit = bank.threshold(100_000.0)
    errors, activations, early, false = [], 0, 0, 0
    changes = 0
    for seed in range(runs):
        truth = _streams.stream(seed)
        table, count, design = _steps.start(truth.values[0])
        found, level = np.zeros(200), np.zeros((len(truth.values), 2))
        level[0] = truth.values[0], 1.0
        count, n = _follow(truth.values, table, count, design, limit, found, level)
        mean, covariance = bank.moments(table[:count])
        best, best_std = _streams.oracle_slope(truth)
        errors.append((mean[1] - _streams.SLOPE, covariance[1, 1] ** 0.5, best - _streams.SLOPE, best_std))
        a, e = crossings(seed, level, AlarmSettings())
        activations, early = activations + a, early + e
        false += _false(found[:n], truth)
        changes += len(truth.changes)
    e = np.array(errors)
    rows = _slope_rows(e, "<= 1.4", "")
    rows += [
        [
            "false batch alarms per 10000",
            "<= 0.7",
            f"{false / runs:.2f}",
            f"± {1.96 * math.sqrt(false + 1) / runs:.2f}",
        ],
        [
            "wear limit: activations per true crossing",
            "<= 1.2",
            f"{activations / runs:.2f}",
            f"{runs} crossings",
        ],
        [
            "wear limit: too early",
            "<= 5 %",
            f"{100 * early / runs:.1f} %",
            f"± {196 * math.sqrt(early + 1) / runs:.1f} %",
        ],
    ]
    note = f"{runs} streams of 10000 cycles, {changes} batch steps; a wear limit drawn for each stream."
    made = [Table("Batch unknown: wear inside the stream", ["what", "bar", "measured", "95 %"], rows, note)]
    return [*made, _delays(quick=quick)]


def _false(found: np.ndarray, truth: _streams.Stream) -> int:
    """Alarms before the first change, and second ones between two changes."""
    batch = np.searchsorted(truth.changes, found, side="right")
    return int((batch == 0).sum()) + sum(int((batch == b).sum()) - 1 for b in set(batch.tolist()) - {0})


def _delays(*, quick: bool) -> Table:
    runs = 30 if quick else 150
    limit = bank.threshold(100_000.0)
    delays: dict[float, list[float]] = {size: [] for size in SIZES}
    lost = dict.fromkeys(SIZES, 0)
    false = 0
    for seed in range(runs):
        truth = _streams.stream(10_000 + seed, sizes=SIZES)
        table, count, design = _steps.start(truth.values[0])
        out = np.zeros(200)
        n = _steps.alarms(truth.values, table, count, design, limit, out)
        false += _false(out[:n], truth)
        ends = np.append(truth.changes, len(truth.values))
        for i, (change, step) in enumerate(zip(truth.changes, truth.steps, strict=True)):
            if len(truth.values) - change < 500:
                continue  # cut off by the end of the stream, not by the detector
            after = out[:n][(out[:n] >= change) & (out[:n] < ends[i + 1])]
            if len(after):
                delays[abs(step)].append(after[0] - change + 1)
            else:
                lost[abs(step)] += 1
    # compared at the rate that was measured, where that is worse than the design
    arl = min(1e5, 1e4 * runs / max(false, 1))
    rows = [
        [
            "false batch alarms per 10000",
            "<= 0.7",
            f"{false / runs:.2f}",
            f"± {1.96 * math.sqrt(false + 1) / runs:.2f}",
        ]
    ]
    for size, seen in delays.items():
        d, bound = np.array(seen), _charts.optimal_delay(size, arl)
        error = 1.96 * d.std() / math.sqrt(len(d)) / bound
        rows.append(
            [f"delay / bound, steps of {size:g} sd", "<= 1.5", f"{d.mean() / bound:.2f}", f"± {error:.2f}"]
        )
        share = 100.0 * lost[size] / (lost[size] + len(d))
        rows.append(
            [
                f"not found before the next step, {size:g} sd",
                "",
                f"{share:.1f} %",
                f"of {lost[size] + len(d)}",
            ]
        )
    note = f"{runs} streams with steps of 0.5 .. 3 sd; delays of the steps that were found before the next."
    return Table("Batch unknown: steps inside the stream", ["what", "bar", "measured", "95 %"], rows, note)


def known_table(*, quick: bool) -> Table:
    runs = 4 if quick else 24
    done = (
        {r["seed"]: r for r in map(json.loads, RESULTS.read_text().splitlines())} if RESULTS.exists() else {}
    )
    rows, false = [], 0
    for seed in range(runs):
        if seed not in done:
            done[seed] = _known_run(seed)
            RESULTS.parent.mkdir(exist_ok=True)
            with RESULTS.open("a") as file:
                file.write(json.dumps(done[seed]) + "\n")
        rows.append([done[seed][k] for k in ("error", "std", "oracle", "oracle_std")])
        false += done[seed]["false"]
    table = _slope_rows(np.array(rows), "<= 1.05", "0.8 .. 1.5")
    table.append(["false batch alarms per 10000", "<= 0.7", f"{false / runs:.2f}", ""])
    return Table(
        "Batch known: wear inside the stream",
        ["what", "bar", "measured", "95 %"],
        table,
        f"{runs} streams of 10000 cycles through all of `track`: scale and process noise learned on the way.",
    )


def _known_run(seed: int) -> dict[str, float]:
    truth = _streams.stream(seed)
    settings = TrackerSettings(batch=BatchKnowledge.KNOWN)
    state, shifts, batch = initial_state(), 0, truth.batch
    for i, z in enumerate(truth.values):
        tracked = track(settings, state, Reading(i, MEAN + UNIT * z, UNIT, batch_id=f"B{batch[i]}"))
        state = tracked.state
        shifts += tracked.shift is not None and batch[i] == 0
    best, best_std = _streams.oracle_slope(truth)
    return {
        "seed": seed,
        "error": float(tracked.wear.rate_per_cycle / UNIT - _streams.SLOPE),
        "std": float(tracked.wear.rate_std / UNIT),
        "oracle": float(best - _streams.SLOPE),
        "oracle_std": float(best_std),
        "false": int(shifts),
    }


def _slope_rows(e: np.ndarray, bar: str, nees_bar: str) -> list[list[str]]:
    """Ratio of root mean square errors, bias and NEES, with bootstrap intervals over streams."""
    rng = np.random.default_rng(0)

    def figures(rows: np.ndarray) -> tuple[float, float, float]:
        ratio = math.sqrt((rows[:, 0] ** 2).mean() / (rows[:, 2] ** 2).mean())
        # the oracle's own error is common to both and is taken out of the bias
        bias = (rows[:, 0] - rows[:, 2]).mean() / _streams.SLOPE
        return ratio, 100.0 * bias, ((rows[:, 0] / rows[:, 1]) ** 2).mean()

    boot = np.array([figures(e[rng.integers(0, len(e), len(e))]) for _ in range(500)])
    low, high = np.percentile(boot, [2.5, 97.5], axis=0)
    ratio, bias, nees = figures(e)
    return [
        ["slope RMSE / oracle", bar, f"{ratio:.3f}", f"{low[0]:.2f} .. {high[0]:.2f}"],
        [
            "slope bias beyond the oracle's",
            "within 2 %",
            f"{bias:+.2f} %",
            f"{low[1]:+.2f} .. {high[1]:+.2f} %",
        ],
        ["slope NEES", nees_bar, f"{nees:.2f}", f"{low[2]:.2f} .. {high[2]:.2f}"],
    ]
