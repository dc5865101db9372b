"""Tracking and alarms: wear, batches, deviant cycles, the in-cycle filter and the cost of a cycle."""

import statistics
import sys
import time
from collections.abc import Iterator

import numpy as np

from impactcell import alarms
from impactcell.alarms import AlarmSettings, CycleInputs
from impactcell.features import extract
from impactcell.tracking import wear_batch
from impactcell.tracking.model_gap import gap_cusum
from impactcell.tracking.signature import tracker
from impactcell.tracking.wear_batch import BatchKnowledge, FrictionObservation, TrackerSettings, initial_state
from tests.benchmarks import (
    _bends,
    _correlated,
    _declared,
    _inside,
    _other_streams,
    _signatures,
    _sizes,
    _slides,
    _steps,
    _told_steps,
    _track,
    _tracker,
)
from tests.benchmarks.table import Table


def tables(*, quick: bool = False) -> Iterator[Table]:
    """Give table by table, so that what is done is printed though a later one is interrupted."""
    for make in (
        cost_table,
        _inside.steps_table,
        _inside.wear_table,
        _track.tables,
        _tracker.starts_table,
        _tracker.known_table,
        _declared.table,
        _correlated.table,
        _other_streams.table,
        _bends.table,
        _bends.step_table,
        _steps.table,
        _told_steps.table,
        _signatures.error_table,
        _signatures.power_table,
        _sizes.table,
    ):
        name, started = f"{make.__module__}.{make.__name__}", time.process_time()
        print(f"  {name} ...", file=sys.stderr, flush=True)
        found = make(quick=quick)
        minutes = (time.process_time() - started) / 60.0
        print(f"  {name}: {minutes:.1f} CPU minutes", file=sys.stderr, flush=True)
        yield from found if isinstance(found, list) else [found]


def cost_table(*, quick: bool) -> Table:
    """Time of one cycle through tracker, signature, model gap and alarms, at 10 kHz."""
    rng = np.random.default_rng(3)
    captures = [_slides.slide(lambda x: 0.2 + 0.0 * x, 0.09, 1e4, 0.42e-6, k)[0] for k in range(20)]
    n = 400 if quick else 1500
    rows = []
    for knowledge in BatchKnowledge:
        config, rules, shape = (
            TrackerSettings(batch=knowledge),
            AlarmSettings(),
            tracker.SignatureSettings(),
        )
        state, book = initial_state(), alarms.initial_state(rules)
        signed, gaps = tracker.initial_state(shape), gap_cusum.GapState()
        took: dict[str, list[float]] = {"tracker": [], "signature": [], "gap and alarms": []}
        for i in range(n):
            reading = FrictionObservation(i, 0.2 + 0.002 * rng.normal(), 0.002, (i + 1) * 10**9, "A")
            t0 = time.thread_time()
            tracked = wear_batch.update(config, state, reading)
            t1 = time.thread_time()
            seen = tracker.update(shape, signed, extract(captures[i % 20]))
            t2 = time.thread_time()
            followed = gap_cusum.update(gaps, 1.0 + 0.02 * rng.normal(), i, 1e5, 1.0)
            inputs = CycleInputs(
                i,
                tracked.wear,
                signature=seen.signature,
                shift=tracked.shift,
                deviation=seen.deviation,
                judged=seen.judged,
                gap=followed.evidence,
                gap_exceeds=followed.exceeds,
            )
            findings = alarms.evaluate(rules, book, inputs)
            book, _ = alarms.update(rules, book, findings, i, reading.time_ns)
            t3 = time.thread_time()
            state, signed, gaps = tracked.state, seen.state, followed.state
            for name, spent in zip(took, (t1 - t0, t2 - t1, t3 - t2), strict=True):
                took[name].append(1e3 * spent)
        whole = [sum(each) for each in zip(*took.values(), strict=True)][n // 4 :]
        parts = ", ".join(f"{name} {statistics.median(t[n // 4 :]):.2f}" for name, t in took.items())
        p99 = float(np.percentile(whole, 99))
        rows.append(
            [
                f"batch {knowledge.value}: ms a cycle",
                "< 1",
                f"{statistics.median(whole):.2f}",
                f"p99 {p99:.2f}; {parts}",
            ]
        )
    return Table(
        "Cost of a cycle",
        ["what", "bar", "median", ""],
        rows,
        f"{n} cycles, the first quarter left out; processor time.",
    )
