"""Batch alarms where the estimates' own standard deviations tell all, part or nothing of their spread."""

import numpy as np

from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import BatchKnowledge, FrictionObservation, TrackerSettings, initial_state
from tests.benchmarks.table import Table

DECLARED = np.array([0.0018, 0.0023, 0.0056, 0.0061])  # as of a waveform fit at four velocities, in turn
EQUAL = np.full(4, 0.0028)
KINDS = {
    "all alike, and right": (EQUAL, EQUAL),
    "different, and right": (DECLARED, DECLARED),
    "different, but the spread is alike": (DECLARED, EQUAL),
    "different, a quarter of the variance beside a shared one": (
        DECLARED,
        np.sqrt(0.002**2 + 0.25 * DECLARED**2),
    ),
}
CYCLES = 600
STEP, STEP_AT, LONGEST = 2.0, 60, 100
SEEDS = 90_000


def shifts(values: np.ndarray, declared: np.ndarray, knowledge: BatchKnowledge) -> list[int]:
    """Cycles at which a shift is reported."""
    state, found = initial_state(), []
    for cycle, value in enumerate(values):
        reading = FrictionObservation(cycle + 1, value, declared[cycle % 4], (cycle + 1) * 10**9, "A")
        tracked = wear_batch.update(TrackerSettings(batch=knowledge), state, reading)
        state = tracked.state
        if tracked.shift is not None:
            found.append(cycle)
    return found


def delay(values: np.ndarray, declared: np.ndarray, knowledge: BatchKnowledge) -> int:
    """Cycles until a step is reported, `LONGEST` if it is not in so many."""
    found = [cycle for cycle in shifts(values, declared, knowledge) if cycle >= STEP_AT]
    return found[0] - STEP_AT if found else LONGEST


def table(*, quick: bool) -> Table:
    """False alarms, and the delay of a step beside a tracker that is told the real standard deviations."""
    runs, rows = 4 if quick else 40, []
    for name, (declared, spread) in KINDS.items():
        for knowledge in BatchKnowledge:
            false, ours, told = 0, [], []
            for seed in range(runs):
                draw = np.random.default_rng(SEEDS + seed)
                values = 0.2 + np.resize(spread, CYCLES) * draw.standard_normal(CYCLES)
                false += len(shifts(values, declared, knowledge))
                stepped = values[: STEP_AT + LONGEST].copy()
                stepped[STEP_AT:] += STEP * float(np.sqrt(np.mean(spread**2)))
                ours.append(delay(stepped, declared, knowledge))
                told.append(delay(stepped, spread, knowledge))
            each = f"{np.mean(ours):.1f}", f"{np.mean(told):.1f}"
            rows.append([name, knowledge.value, f"{false}", *each])
    cycles = runs * CYCLES
    return Table(
        "Declared standard deviations of other kinds",
        [
            "standard deviations are",
            "batch",
            f"false alarms in {cycles} cycles",
            "cycles to a step, ours",
            "told the spread",
        ],
        rows,
        f"{runs} streams a row without wear or change; designed: {1e-5 * cycles:.2f} false alarms. "
        f"A step of {STEP:g} standard deviations comes at cycle {STEP_AT}; one that is not found in "
        f"{LONGEST} cycles counts as {LONGEST}.",
    )
