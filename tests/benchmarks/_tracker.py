"""The whole tracker on the streams with the batch known, and its first cycles.

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
from tests.benchmarks import _inside, _streams
from tests.benchmarks.table import Table

UNIT, MEAN = 0.002, 0.2  # of a series in mu_s
KNOWN_SEEDS = _streams.REPORTED + 20_000
START_SEEDS = _streams.REPORTED + 90_000
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
