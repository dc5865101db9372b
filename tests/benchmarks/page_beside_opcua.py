"""What many viewers of the page cost a client of OPC UA: its delays with and without them, by turns."""

import os
import sys

import numpy as np

from tests.benchmarks._load import EVERY_CORE, OTHERS, Load, load
from tests.benchmarks.page import CELLS, IN_DEPTH, VIEWERS
from tests.benchmarks.table import Table

ROUNDS, SECONDS = 3, 60.0
"""Rounds of one run without and one with viewers, and the length of each run, s."""
BAR_MS = 3.0
DRAWS = 2000
"""Of the bootstrap; each draws runs, and cycles in them."""


def p99_ms(runs: list[Load]) -> float:
    """99th percentile of the delays of all runs."""
    return float(np.percentile(np.concatenate([run.delays_ms for run in runs]), 99))


def p99_difference(without: list[Load], viewed: list[Load]) -> tuple[float, float, float]:
    """Return by how much the 99th percentile of all delays differs, ms, and its 95 % interval."""
    draw = np.random.default_rng(0)

    def drawn(runs: list[Load]) -> float:
        chosen = (runs[i].delays_ms for i in draw.integers(0, len(runs), len(runs)))
        return float(np.percentile(np.concatenate([draw.choice(one, len(one)) for one in chosen]), 99))

    low, high = np.percentile([drawn(viewed) - drawn(without) for _ in range(DRAWS)], [2.5, 97.5])
    return p99_ms(viewed) - p99_ms(without), float(low), float(high)


def tables(*, quick: bool = False) -> list[Table]:
    """Delays beside viewers."""
    os.sched_setaffinity(0, OTHERS)
    runs: dict[bool, list[Load]] = {False: [], True: []}
    for turn in range(1 if quick else ROUNDS):
        for viewed in (False, True) if turn % 2 == 0 else (True, False):
            runs[viewed].append(load(CELLS, SECONDS / 4 if quick else SECONDS, viewed=viewed))
            print("viewed:", viewed, " | ".join(runs[viewed][-1].row()), file=sys.stderr, flush=True)
    os.sched_setaffinity(0, EVERY_CORE)
    more, low, high = p99_difference(runs[False], runs[True])
    lines = [
        (
            f"{'with' if viewed else 'without'} viewers",
            f"{p99_ms(made):.0f} ms",
            " / ".join(f"{np.percentile(run.delays_ms, 99):.0f}" for run in made),
            f"{np.mean([run.cpu_per_cycle_ms for run in made]):.1f} ms",
            f"{sum(run.missed for run in made)}",
        )
        for viewed, made in runs.items()
    ]
    difference = f"{more:+.1f} ms"
    text = f"{difference if more <= BAR_MS else f'**{difference}**'} ({low:+.1f} to {high:+.1f})"
    return [
        Table(
            f"{CELLS} cells of 2 cycles/s, {VIEWERS} viewers of the page, {IN_DEPTH} of them of one cell",
            ("the service", "cycle to notification, p99", "run by run", "CPU a cycle", "cycles missed"),
            lines,
            f"p99 with viewers: {text}, for a bar of +{BAR_MS:g} ms. Client, modules and viewers share "
            "the other core, where the viewers stand back (nice 10): in a plant they have their own.",
        )
    ]
