"""What one tree costs, printed as JSON; run as a file with the tree on PYTHONPATH, which may be an older one.

Only what `two_trees` asks for; names that have changed are looked for as they are and as they were. Fieldbus
and service are the tree's own benchmarks of the same work.
"""

import asyncio
import importlib
import json
import logging
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

CYCLES = 1200
"""Cycles that are tracked."""
FIRST = 300
"""Of these the first, left out: compilation, and what is learned at first."""


def named(*places: str) -> Any:
    """Return the first of `module:name` that there is."""
    for place in places:
        module, _, name = place.partition(":")
        try:
            return getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError):
            continue
    raise ImportError(f"none of {', '.join(places)}: add its present name")


def least(run: Callable[[], object], repeats: int, rounds: int = 8) -> float:
    """Least processor time of one call, s."""
    run()
    spent = []
    for _ in range(rounds):
        began = time.process_time()
        for _ in range(repeats):
            run()
        spent.append((time.process_time() - began) / repeats)
    return min(spent)


def physics() -> dict[str, float]:
    """Taps alone and together, with samples, and to rest without any."""
    Ensemble, Plant = named("impactcell.physics:Ensemble"), named("impactcell.physics:Plant")
    Tap = named("impactcell.physics:TapInput", "impactcell.physics:Strike")
    simulate = named("impactcell.physics:simulate_tap", "impactcell.physics:strike")
    times = np.linspace(0.0, 0.06, 1200)
    effects = {"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0}}
    plant = Plant(6.5e5, 465.0, 0.2, 0.152, effects=effects)
    tap = Tap(0.075, 18.9, halts_at_separation=True)
    one, many = (
        Ensemble([tap] * n, list(effects), force_time_s=[times] * n, position_time_s=[times] * n)
        for n in (1, 60)
    )
    theta = one.parameters(plant)
    to_rest = getattr(many, "outputs", None) or many.figures
    return {
        "one tap as an object, 1200 samples": least(lambda: simulate(plant, tap).sample(times), 100),
        "one tap by `Ensemble.traces`": least(lambda: one.traces(theta), 200),
        "a tap of 60 by `Ensemble.traces`": least(lambda: many.traces(theta), 10) / 60,
        "a tap of 60 to rest": least(lambda: to_rest(theta), 20) / 60,
    }


def tracking() -> dict[str, float]:
    """One cycle through the tracker, by what the PLC tells of batches: median and mean."""
    Knowledge = named("impactcell.tracking.wear_batch:BatchKnowledge", "impactcell.tracking:BatchKnowledge")
    Settings = named("impactcell.tracking.wear_batch:TrackerSettings", "impactcell.tracking:TrackerSettings")
    Observation = named("impactcell.tracking.wear_batch:FrictionObservation", "impactcell.tracking:Reading")
    initial = named("impactcell.tracking.wear_batch:initial_state", "impactcell.tracking:initial_state")
    update = named("impactcell.tracking.wear_batch:update", "impactcell.tracking:track")
    costs = {}
    for knowledge in Knowledge:
        draw, settings, state, spent = np.random.default_rng(3), Settings(batch=knowledge), initial(), []
        for cycle in range(CYCLES):
            mu_s = 0.2 + 0.002 * draw.normal() + 0.004 * (cycle // 400)
            observation = Observation(cycle, mu_s, 0.002, (cycle + 1) * 10**9, str(cycle // 400))
            began = time.thread_time()
            state = update(settings, state, observation).state
            spent.append(time.thread_time() - began)
        costs[f"a cycle, batch {knowledge.value}: median"] = float(np.median(spent[FIRST:]))
        costs[f"a cycle, batch {knowledge.value}: mean"] = float(np.mean(spent[FIRST:]))
    return costs


def fieldbus() -> dict[str, float]:
    """Client and server together, by the tree's own benchmark."""
    captures = named("tests.benchmarks.fieldbus:_captures")
    return {"20 000 force and 4000 position samples": asyncio.run(captures(40))[0]}


def service() -> dict[str, float]:
    """A cycle through worker, journal and OPC UA values, by the tree's own benchmark."""
    cycles = named("tests.benchmarks._cycle_parts:cycles")
    cell_file = named("tests.benchmarks._load:cell_file", "tests.benchmarks._modules:cell_file")
    with tempfile.TemporaryDirectory() as directory:
        rows = asyncio.run(cycles(cell_file(Path(directory), "cell", 1, 0, journal=True), 120))
    parts = ("thread of the cell", "OPC UA: values and conditions")
    whole = [sum(row[part] for part in parts) for row in rows]
    return {"a cycle: median": float(np.median(whole)), "a cycle: mean": float(np.mean(whole))}


if __name__ == "__main__":
    logging.disable(logging.WARNING)
    topics = {topic.__name__: topic for topic in (physics, tracking, fieldbus, service)}
    print(json.dumps(topics[sys.argv[1]]()))
