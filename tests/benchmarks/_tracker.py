"""The whole of `track` on the streams: batch known, and beside the compiled bank with the batch unknown.

Each stream that is done is kept in bench-results/, for the code it was run with, so that an interrupted run
goes on where it was.
"""

import hashlib
import json
import math
import sys
from pathlib import Path

import numpy as np

from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import BatchKnowledge, FrictionObservation, TrackerSettings, initial_state
from impactcell.tracking.wear_batch.run_length_model import SLOPE
from tests.benchmarks import _charts, _inside, _steps, _streams
from tests.benchmarks.table import Table

UNIT, MEAN = 0.002, 0.2  # of a series in mu_s
KNOWN_SEEDS = _streams.REPORTED + 20_000
START_SEEDS = _streams.REPORTED + 30_000
SOURCES = sorted(Path(wear_batch.__file__).parent.glob("*.py"))
CODE = hashlib.sha256(b"".join(source.read_bytes() for source in SOURCES)).hexdigest()[:12]


def known_table(*, quick: bool) -> Table:
    runs = 6 if quick else 120
    done = [_run(KNOWN_SEEDS + i, BatchKnowledge.KNOWN) for i in range(runs)]
    e = np.array([[d["error"], d["std"], d["oracle"]] for d in done])
    rows = _inside.slope_rows(e, "<= 1.05", "0.8 .. 1.5")
    within = between = steps = 0
    for d in done:
        changes = set(_streams.stream(int(d["seed"])).changes.tolist())
        within += sum(change not in changes for _, change in d["shifts"])
        between += sum(change in changes for _, change in d["shifts"])
        steps += len(changes)
    rows.append(
        [
            "false alarms within a batch per 10000",
            "<= 0.7",
            f"{within / runs:.2f}",
            _inside.per_stream(within, runs),
        ]
    )
    rows.append(["batches said to differ", "", f"{100 * between / steps:.0f} %", f"of {steps}"])
    note = f"{runs} streams through all of `track`: scale, outliers and process noise learned on the way."
    return Table("Batch known: wear inside the stream", ["what", "bar", "measured", "95 %"], rows, note)


def unknown_table(*, quick: bool) -> Table:
    """The whole tracker beside the bank alone, which is told the scale of the noise, on the same streams."""
    runs = 4 if quick else 20
    rows, figures = [], {}
    for size in _inside.SIZES:
        figures[size] = (np.zeros(0), np.zeros(0))
    whole, alone, false = [], [], [0, 0]
    same = found_by_bank = 0
    for i in range(runs):
        seed = _inside.STEP_SEEDS + i
        truth = _streams.stream(seed, sizes=_inside.SIZES)
        done = _run(seed, BatchKnowledge.UNKNOWN, _inside.SIZES)
        ours = np.array([cycle for cycle, _ in done["shifts"]], dtype=float)
        run = _steps.Run.start(truth.values[0])
        bank = run.follow(truth.values[1:])
        mean = run.moments()[0][SLOPE]
        whole.append((done["error"], done["std"], done["oracle"]))
        alone.append((mean - _streams.SLOPE, 1.0, done["oracle"]))
        pairs = zip(_streams.first_alarms(ours, truth), _streams.first_alarms(bank, truth), strict=True)
        for (size, a), (_, b) in pairs:
            mine, its = figures[size]
            figures[size] = np.append(mine, a), np.append(its, b)
        for k, found in enumerate((ours, bank)):
            false[k] += _streams.false_alarms(found, truth)
        found_by_bank += len(bank)
        same += sum(bool(np.any(np.abs(ours - t) <= 3)) for t in bank)

    def ratio(pairs: list[tuple[float, float, float]]) -> float:
        e = np.array(pairs)
        return math.sqrt((e[:, 0] ** 2).mean() / (e[:, 2] ** 2).mean())

    rows.append(["slope RMSE / oracle", f"{ratio(whole):.3f}", f"{ratio(alone):.3f}"])
    rows.append(["false batch alarms per 10000", *(f"{n / runs:.2f}" for n in false)])
    for size, both in figures.items():
        bound = _charts.optimal_delay(size, _steps.DESIGN)
        found = np.isfinite(both[0]) & np.isfinite(both[1])
        rows.append(
            [f"delay / bound, steps of {size:g} sd", *(f"{d[found].mean() / bound:.3f}" for d in both)]
        )
        rows.append([f"not found, {size:g} sd", *(f"{(~np.isfinite(d)).sum()} of {len(d)}" for d in both)])
    rows.append(["the bank's alarms that the tracker gives within 3 cycles", f"{same}", f"{found_by_bank}"])
    note = f"{runs} streams of 10000 cycles; delays of the steps that both found."
    return Table("Batch unknown: all of `track` beside the bank", ["what", "`track`", "bank"], rows, note)


def starts_table(*, quick: bool) -> Table:
    """False alarms of young trackers, where the scale of the noise rests on few cycles."""
    runs, cycles = (100 if quick else 500), 100
    rows = []
    for knowledge in BatchKnowledge:
        for outliers in (0.0, _streams.OUTLIERS):
            at: list[int] = []
            for i in range(runs):
                rng = np.random.default_rng([START_SEEDS, i])
                z = rng.normal(size=cycles)
                odd = rng.random(cycles) < outliers
                z[odd] += _streams.OUTLIER_STD * rng.normal(size=int(odd.sum()))
                state = initial_state()
                for k, value in enumerate(z.tolist()):
                    said = "A" if knowledge is BatchKnowledge.KNOWN else None
                    done = wear_batch.update(
                        TrackerSettings(batch=knowledge),
                        state,
                        FrictionObservation(k, MEAN + UNIT * value, UNIT, batch_id=said),
                    )
                    state = done.state
                    if done.shift is not None:
                        at.append(k)
            rate = 1e5 * len(at) / (runs * cycles)
            rows.append(
                [
                    f"batch {knowledge.value}, {100 * outliers:g} % outliers",
                    f"{rate:.1f}",
                    f"± {1.96e5 * math.sqrt(len(at) + 1) / (runs * cycles):.1f}",
                    f"{len(at)}",
                    ", ".join(map(str, sorted(at)[:12])),
                ]
            )
    note = f"{runs} starts of {cycles} cycles without a change; the design is 1 in 100000 cycles."
    columns = ["what", "per 100000 cycles", "95 %", "alarms", "at cycles"]
    return Table("False alarms in the first 100 cycles", columns, rows, note)


def _run(seed: int, knowledge: BatchKnowledge, sizes: tuple[float, ...] = ()) -> dict:
    """Outcome of one stream, from bench-results/ if this code has run it before."""
    kept = Path(f"bench-results/tracking-{CODE}.jsonl")
    key = f"{knowledge.value} {seed}"
    if kept.exists():
        for line in kept.read_text().splitlines():
            done = json.loads(line)
            if done["key"] == key:
                return done
    print(f"    stream {key}", file=sys.stderr, flush=True)
    truth = _streams.stream(seed, sizes=sizes)
    settings, state, batch = TrackerSettings(batch=knowledge), initial_state(), truth.batch.tolist()
    shifts = []
    for i, z in enumerate(truth.values.tolist()):
        done = wear_batch.update(
            settings, state, FrictionObservation(i, MEAN + UNIT * z, UNIT, batch_id=f"B{batch[i]}")
        )
        state = done.state
        if done.shift is not None:
            shifts.append((i, done.shift.change_cycle))
    best, _ = _streams.oracle_slope(truth)
    outcome = {
        "key": key,
        "seed": seed,
        "error": float(done.wear.rate_per_cycle / UNIT - _streams.SLOPE),
        "std": float(done.wear.rate_std / UNIT),
        "oracle": float(best - _streams.SLOPE),
        "shifts": shifts,
    }
    kept.parent.mkdir(exist_ok=True)
    with kept.open("a") as file:
        file.write(json.dumps(outcome) + "\n")
    return outcome
