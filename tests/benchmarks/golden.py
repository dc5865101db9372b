"""Results of two trees, number by number to the last bit: `python -m tests.benchmarks.golden OLD_TREE`.

Each tree does the same work in a process of its own, from inputs that are made once and handed to both. A row
is an output: equal, or what differs, by how much at most and where. What a command writes is compared as it
is written (`estimate` seven, `discrepancy` six digits); everything else to the last bit.
"""

import argparse
import json
import math
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeGuard

import numpy as np

from tests.benchmarks.table import Table
from tests.benchmarks.two_trees import ROOT, THREADS
from tests.taps import Tap

OUTPUTS = Path(__file__).with_name("_golden_outputs.py")
CAMPAIGNS = ROOT.parent / "shared" / "data" / "sample-campaigns"
JOURNAL = ROOT / "tests" / "data" / "journal-format-3.sqlite"
"""Written by the last version whose state has no format number; every tree opens it."""
OF_CAMPAIGNS = ("estimate", "discrepancy")
TOPICS = (*OF_CAMPAIGNS, "track", "journal", "cycles")
SEED = 15
"""Of scatter and noise."""
SERIES_CYCLES = 800
CYCLES = 200
FRICTION_STD = 0.002
"""mu_s, from cycle to cycle and of one observation."""
WEAR_PER_CYCLE = {"series": 8e-5, "cycles": 2e-4}
"""mu_s a cycle; the limit of both is passed before the end."""
BATCHES = ((0.0, "A"), (0.3, "B"), (0.65, "C"))
"""Fraction of the series at which each begins."""
OFFSETS = {"A": 0.0, "B": 0.012, "C": -0.015}
"""mu_s of each batch above the first."""
WITHOUT_FORCE, DEVIANT = 45, 110
"""Cycles: the force was not recorded; friction is half as large again around one place."""
PATCH = {"friction_patch": {"amplitude": 0.5, "position_m": 0.002, "width_m": 0.0004}}

Leaf = float | int | str | bool | None


@dataclass(frozen=True, slots=True)
class Comparison:
    """What became of one output.

    Attributes
    ----------
    values : int
        That both trees have.
    differing : int
        Of these, those that are not equal.
    largest : float
        Largest relative difference of two numbers, |a - b| / max(|a|, |b|); inf where one is not finite.
    place : str
        Where that is, with the value now and the one before; of words that differ where no number does.
    only_old, only_new : tuple of str
        Places that the other tree has not.
    """

    values: int
    differing: int
    largest: float
    place: str
    only_old: tuple[str, ...]
    only_new: tuple[str, ...]

    @property
    def is_equal(self) -> bool:
        """Nothing differs, nothing is missing and nothing came."""
        return not (self.differing or self.only_old or self.only_new)


def compare(old: Mapping[str, Leaf], new: Mapping[str, Leaf]) -> Comparison:
    """Compare what two trees have at each place; nan is equal to nan, 0 is not to -0."""
    both = [place for place in old if place in new]
    differing, largest, where = 0, 0.0, ""
    for place in both:
        before, now = old[place], new[place]
        if _bits(before) == _bits(now):
            continue
        differing += 1
        difference = _relative(before, now)
        if not where or difference > largest:
            largest, where = max(largest, difference), f"{place}: {_written(now)} for {_written(before)}"
    return Comparison(
        len(both),
        differing,
        largest,
        where,
        tuple(place for place in old if place not in new),
        tuple(place for place in new if place not in old),
    )


def _is_number(value: Leaf) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _bits(value: Leaf) -> object:
    """Give what tells two values apart; of all nan one."""
    if not _is_number(value):
        return value, type(value).__name__
    return "nan" if value != value else struct.pack("d", value)


def _relative(before: Leaf, now: Leaf) -> float:
    """Relative difference of two numbers that differ; 0 where they are not both numbers."""
    if not (_is_number(before) and _is_number(now)):
        return 0.0
    if not (math.isfinite(before) and math.isfinite(now)):
        return math.inf
    return abs(before - now) / (max(abs(before), abs(now)) or 1.0)


def _written(value: Leaf) -> str:
    return f"{value:.6g}" if isinstance(value, float) else repr(value)[:60]


def patterns(places: Sequence[str]) -> str:
    """Name the places of a list once each: without the numbers of cycles, points and members."""
    found = dict.fromkeys(re.sub(r"/(cycle )?\d+(?=/|$)", "", place) for place in places)
    shown = list(found)[:3]
    return ", ".join(shown) + (f" and {len(found) - len(shown)} more" if len(found) > len(shown) else "")


def make_inputs(directory: Path) -> None:
    """Make the series and the captures that both trees are given, and a copy of the journal."""
    shutil.copy(JOURNAL, directory / "journal.sqlite")
    draw = np.random.default_rng(SEED)
    lines = ["cycle,mu_s,mu_s_std,batch"]
    for cycle in range(SERIES_CYCLES):
        mu_s, batch = _friction(draw, "series", cycle, SERIES_CYCLES)
        lines.append(f"{cycle},{mu_s!r},{FRICTION_STD},{batch}")
    (directory / "series.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    headers, samples = [], {}
    for cycle in range(CYCLES):
        mu_s, batch = _friction(draw, "cycles", cycle, CYCLES)
        effects = {**Tap().effects, **(PATCH if cycle == DEVIANT else {})}
        tap = Tap(velocity_m_s=0.065, mu_s=mu_s, stroke_m=1.5e-3, effects=effects)
        capture = tap.capture(draw, force_hz=1e5)
        for name, channel in (("force", capture.force), ("position", capture.position)):
            if channel is not None and not (cycle == WITHOUT_FORCE and name == "force"):
                samples[f"{cycle} {name}"] = channel.values
                samples[f"{cycle} {name} time_s"] = channel.time_s
        headers.append(
            {
                "cycle": cycle + 1,
                "velocity_m_s": capture.velocity_m_s,
                "mass_kg": capture.mass_kg,
                "stroke_m": capture.stroke_m,
                "time_ns": (cycle + 1) * 1_500_000_000,
                "batch_id": batch,
                "noise_std": {"force": 0.4, "position": 1.5e-6},
            }
        )
    np.savez(directory / "captures.npz", headers=np.array(json.dumps(headers)), **samples)


def _friction(draw: np.random.Generator, what: str, cycle: int, cycles: int) -> tuple[float, str]:
    """mu_s and batch of a cycle."""
    batch = [name for begins, name in BATCHES if cycle >= begins * cycles][-1]
    mu_s = 0.2 + WEAR_PER_CYCLE[what] * cycle + OFFSETS[batch] + draw.normal(0.0, FRICTION_STD)
    return float(mu_s), batch


def outputs(tree: Path, topic: str, inputs: Path, campaigns: Path) -> dict[str, dict[str, Leaf]]:
    """Run a topic's work in a tree.

    Raises
    ------
    RuntimeError
        It failed there, with what it said.
    """
    environment = {**os.environ, **dict.fromkeys(THREADS, "1"), "PYTHONPATH": str(tree)}
    command = [sys.executable, str(OUTPUTS), topic, str(inputs), str(campaigns)]
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{topic} in {tree}: {done.stderr.strip()}")
    found: dict[str, dict[str, Leaf]] = json.loads(done.stdout.splitlines()[-1])
    return found


def table(old: Path, topics: Sequence[str], campaigns: Path) -> Table:
    """Compare this tree with an older one."""
    rows = []
    with tempfile.TemporaryDirectory() as directory:
        inputs = Path(directory)
        make_inputs(inputs)
        for topic in topics:
            if topic in OF_CAMPAIGNS and not campaigns.is_dir():
                rows.append((topic, "skipped", f"there is no {campaigns.name}", "", "", "", ""))
                continue
            print(f"  {topic} ...", file=sys.stderr, flush=True)
            before, now = (outputs(tree, topic, inputs, campaigns) for tree in (old, ROOT))
            rows.extend(
                (topic, what, *row(compare(before.get(what, {}), now.get(what, {}))))
                for what in dict.fromkeys((*before, *now))
            )
    head = ("topic", "output", "values", "differ", "largest relative difference", "where", "only in one tree")
    return Table("The same work in two trees, to the last bit", head, rows)


def row(found: Comparison) -> tuple[str, str, str, str, str]:
    """Write a comparison as the cells of a row."""
    if found.is_equal:
        return str(found.values), "equal", "", "", ""
    only = [
        f"{len(places)} {which}: {patterns(places)}"
        for which, places in (("before", found.only_old), ("now", found.only_new))
        if places
    ]
    largest = f"{found.largest:.2g}" if found.largest else ""
    return str(found.values), str(found.differing or "equal"), largest, found.place, "; ".join(only)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.golden", description=__doc__)
    parser.add_argument("old", type=Path, help="root of a checkout to compare with")
    parser.add_argument("--topics", nargs="+", choices=TOPICS, default=TOPICS)
    parser.add_argument("--campaigns", type=Path, default=CAMPAIGNS, help="directory of the sample campaigns")
    chosen = parser.parse_args()
    print(table(chosen.old.resolve(), chosen.topics, chosen.campaigns.resolve()).markdown())
    return 0


if __name__ == "__main__":
    sys.exit(main())
