"""Wear, batches and outliers together, batch unknown, through the public `track` and its alarms.

Beside an oracle that knows the noise, the outliers and when batches changed, and alarms where P(level above
limit) has been beyond `SURE` for as long as the alarm's own delay. Each stream that is done is kept in
bench-results/, for the code it was run with: ``python -m tests.benchmarks._track FIRST COUNT`` runs a piece,
``python -m tests.benchmarks._track STREAMS`` prints the tables of so many.
"""

import hashlib
import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.special import ndtr
from scipy.stats import poisson

import impactcell
from impactcell.alarms.rules import RULES, wear_limit, wear_warning
from impactcell.tracking import wear_batch
from tests.benchmarks import _charts, _steps, _streams, _warning
from tests.benchmarks.table import Table

UNIT, MEAN = 0.002, 0.2  # of a series in mu_s
SEEDS = _streams.REPORTED + 120_000
SIZES = (0.5, 1.0, 2.0, 3.0)
BARS = {0.5: "1.4", 1.0: "1.25", 2.0: "1.2", 3.0: "1.2"}
SURE = 0.98  # of the oracle
ROOM = 500  # cycles that there must be after a step, for its delay to count
SLOPE_STD, UNKNOWN_STD = 0.1, 1e4  # the oracle's priors: of the slope as ours, of level and steps flat
RULE_FILES = [Path(str(rule.__file__)) for rule in (wear_limit, wear_warning)]
SOURCES = [*Path(wear_batch.__file__).parent.glob("*.py"), *RULE_FILES]
CODE = hashlib.sha256(b"".join(source.read_bytes() for source in sorted(SOURCES))).hexdigest()[:12]
KEPT = Path(f"bench-results/track-{CODE}.jsonl")


def crossing(seed: int) -> float:
    """Wear limit of a stream, in sd above where it begins: drawn, and crossed inside the stream."""
    return float(np.random.default_rng([5, seed]).uniform(0.8, 2.8))


def oracle_moments(truth: _streams.Stream) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Mean and covariance of level, slope and offset after each cycle, of who knows all else."""
    mean, covariance = np.zeros(3), np.diag([UNKNOWN_STD**2, SLOPE_STD**2, 0.0])
    changes = set(truth.changes.tolist())
    for t, value in enumerate(truth.values.tolist()):
        if t:
            mean[0] += mean[1]
            covariance[0] += covariance[1]
            covariance[:, 0] += covariance[:, 1]
        if t in changes:
            covariance[2, 2] += UNKNOWN_STD**2
        if not truth.outlier[t]:
            gain = covariance[:, 0] + covariance[:, 2]
            spread = gain[0] + gain[2] + 1.0
            mean = mean + gain / spread * (value - mean[0] - mean[2])
            covariance = covariance - np.outer(gain, gain) / spread
        yield mean.copy(), covariance.copy()


def oracle_alarm(known: list[tuple[np.ndarray, np.ndarray]], limit: float) -> float:
    """Cycle at which who knows all but level and slope has been sure for long enough; inf if never."""
    sure = (ndtr((mean[0] - limit) / math.sqrt(covariance[0, 0])) > SURE for mean, covariance in known)
    return _warning.first_sure(sure, RULES["WearLimit"].settings.on_delay)


def run(seed: int) -> dict:
    """Outcome of one stream, from bench-results/ if this code has run it before."""
    if KEPT.exists():
        for line in KEPT.read_text().splitlines():
            done = json.loads(line)
            if done["seed"] == seed:
                return done
    truth, limit = _streams.stream(seed, sizes=SIZES), crossing(seed)
    series = impactcell.track(
        np.arange(len(truth.values)),
        MEAN + UNIT * truth.values,
        np.full(len(truth.values), UNIT),
        limit=MEAN + UNIT * limit,
    )
    best, _ = _streams.oracle_slope(truth)
    known = list(oracle_moments(truth))
    outcome = {
        "seed": seed,
        "error": series.wear.rate_per_cycle / UNIT - _streams.SLOPE,
        "std": series.wear.rate_std / UNIT,
        "oracle": best - _streams.SLOPE,
        "shifts": [alarm.cycle for alarm in series.alarms if alarm.alarm == "BatchShift"],
        "worn": [alarm.cycle for alarm in series.alarms if alarm.alarm == "WearLimit"],
        "oracle_worn": oracle_alarm(known, limit),
        **_warning.outcome(series, known, limit),
    }
    KEPT.parent.mkdir(exist_ok=True)
    with KEPT.open("a") as file:
        file.write(json.dumps(outcome) + "\n")
    return outcome


def delays(found: np.ndarray, truth: _streams.Stream) -> list[tuple[float, float, bool]]:
    """Size of each step, cycles to its first alarm or, without one, to the next step; found at all."""
    ends = np.append(truth.changes[1:], len(truth.values))
    seen = []
    for change, end, step in zip(truth.changes, ends, truth.steps, strict=True):
        if len(truth.values) - change < ROOM:
            continue
        after = found[(found >= change) & (found < end)]
        delay = float(after[0] - change + 1) if len(after) else float(end - change)
        seen.append((abs(float(step)), delay, len(after) > 0))
    return seen


def tables(*, quick: bool, streams: int = 200) -> list[Table]:
    done = [run(SEEDS + i) for i in range(4 if quick else streams)]
    return [_alarm_table(done), _warning.table(done, _crossed(done)), _shift_table(done)]


def _crossed(done: list[dict]) -> np.ndarray:
    return np.array([crossing(d["seed"]) / _streams.SLOPE for d in done])


def _alarm_table(done: list[dict]) -> Table:
    crossed = _crossed(done)
    columns = []
    for first in (
        [d["worn"][0] if d["worn"] else math.inf for d in done],
        [d["oracle_worn"] for d in done],
    ):
        at = np.array(first, dtype=float)
        never, early = np.isinf(at), at < crossed
        delay = np.where(never, float(_streams.CYCLES), at) - crossed
        came = delay[~never & ~early]
        columns.append(
            [
                _warning.share(never),
                f"{np.median(delay):.0f}",
                f"{np.median(came):.0f} of {len(came)}" if len(came) else "none came",
                _warning.share(early),
                "",
            ]
        )
    columns[0][4] = f"{np.mean([len(d['worn']) for d in done]):.2f}"
    rows = zip(
        (
            "never came before the stream ended",
            "median delay in cycles, one that never came at the end of the stream",
            "median delay in cycles of those that came, and not too early",
            "too early",
            "activations a stream",
        ),
        ("oracle's + 2 %", "oracle's + 150 or 10 %", "", "2.5 %", ""),
        *columns,
        strict=True,
    )
    left = np.median(_streams.CYCLES - crossed)
    note = (
        f"{len(done)} streams of {_streams.CYCLES} cycles with a limit drawn for each, crossed {left:.0f} "
        "cycles (median) before the end; the alarm of the service's own rules. The oracle is told the noise, "
        f"the outliers and when batches changed, and alarms at {100 * SURE:g} %. 95 % intervals."
    )
    return Table(
        "Wear alarm through `track`, batch unknown", ["what", "bar", "ours", "oracle"], list(rows), note
    )


def _shift_table(done: list[dict]) -> Table:
    e = np.array([[d["error"], d["std"], d["oracle"]] for d in done])
    squares, best = e[:, 0] ** 2, e[:, 2] ** 2
    rng = np.random.default_rng(0)
    draws = rng.integers(0, len(e), (2000, len(e)))
    ratios = np.sqrt(squares[draws].mean(axis=1) / best[draws].mean(axis=1))
    low, high = np.quantile(ratios, [0.025, 0.975])
    nees = float((squares / e[:, 1] ** 2).mean())
    rows = [
        [
            "slope RMSE / oracle",
            "1.4",
            f"{math.sqrt(squares.mean() / best.mean()):.3f}",
            f"{low:.2f}-{high:.2f}",
        ],
        ["slope, squared error over the variance told", "", f"{nees:.2f}", ""],
    ]
    seen: dict[float, list[tuple[float, bool]]] = {size: [] for size in SIZES}
    false = 0
    for d in done:
        truth, found = _streams.stream(d["seed"], sizes=SIZES), np.array(d["shifts"])
        false += _streams.false_alarms(found, truth)
        for size, delay, is_found in delays(found, truth):
            seen[size].append((delay, is_found))
    for size, outcomes in seen.items():
        bound = _charts.optimal_delay(size, _steps.DESIGN)
        ratio = np.array([delay for delay, _ in outcomes]) / bound
        error = 1.96 * ratio.std() / math.sqrt(len(ratio))
        lost = sum(not is_found for _, is_found in outcomes)
        rows.append(
            [
                f"delay / bound, {size:g} sd",
                BARS[size],
                f"{ratio.mean():.3f} ± {error:.3f}",
                f"{lost} of {len(ratio)} not found",
            ]
        )
    cycles = len(done) * _streams.CYCLES
    at_least = poisson.sf(false - 1, cycles / _steps.DESIGN)
    rows.append(
        [
            "false batch alarms per 100 000 cycles",
            "1",
            f"{1e5 * false / cycles:.2f}",
            f"{false}, at the design p = {at_least:.2g}",
        ]
    )
    note = (
        f"{len(done)} streams of {_streams.CYCLES} cycles with steps of 0.5 .. 3 sd every 500-1500 cycles; a "
        f"step that is not found counts with the cycles to the next, one in the last {ROOM} cycles not. "
        "A second alarm between two steps is a false one. The bound: Moustakides 1986, wear and level known."
    )
    return Table(
        "Batches and slope through `track`, batch unknown", ["what", "bar", "measured", ""], rows, note
    )


if __name__ == "__main__":
    if len(sys.argv) == len(["program", "streams"]):
        print("\n".join(table.markdown() for table in tables(quick=False, streams=int(sys.argv[1]))))
    else:
        first, count = int(sys.argv[1]), int(sys.argv[2])
        for i in range(first, first + count):
            run(SEEDS + i)
