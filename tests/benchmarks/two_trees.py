"""Processor time of the same work in two trees, taking turns: `python -m tests.benchmarks.two_trees OLD`.

Each part runs in a process of its own, a round of this tree after a round of the other; of the rounds the
least counts, for everything else that runs on the machine only ever adds.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.table import Table

ROOT = Path(__file__).resolve().parents[2]
LOAD = Path(__file__).with_name("_two_trees_load.py")
TOPICS = ("physics", "tracking", "fieldbus", "service")
BAR = 1.05
"""Largest ratio of the times: 5 % more."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Of each process one: processor time of several is another thing."""


def costs(tree: Path, topic: str) -> dict[str, float]:
    """Run a topic's work in a tree once; seconds of what it measures."""
    environment = {**os.environ, **dict.fromkeys(THREADS, "1"), "PYTHONPATH": str(tree)}
    command = [sys.executable, str(LOAD), topic]
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{topic} in {tree}: {done.stderr.strip()}")
    measured: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return measured


def table(old: Path, topics: Sequence[str], rounds: int) -> Table:
    """Compare this tree with an older one."""
    rows = []
    for topic in topics:
        before, now = [], []
        for number in range(rounds):
            print(f"  {topic}, round {number + 1} of {rounds} ...", file=sys.stderr, flush=True)
            before.append(costs(old, topic))
            now.append(costs(ROOT, topic))
        for what in now[0]:
            least_before, least_now = (min(each[what] for each in tree) for tree in (before, now))
            ratio = least_now / least_before
            written = f"{ratio:.2f}" if ratio <= BAR else f"**{ratio:.2f}**"
            rows.append((topic, what, f"{1e6 * least_before:.1f}", f"{1e6 * least_now:.1f}", written))
    head = ("topic", "what", "before, µs", "now, µs", f"ratio, at most {BAR:g}")
    note = f"Processor time, the least of {rounds} rounds of each tree in turns; one thread."
    return Table("Two trees in one run", head, rows, note)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.two_trees", description=__doc__)
    parser.add_argument("old", type=Path, help="root of a checkout to compare with")
    parser.add_argument("--topics", nargs="+", choices=TOPICS, default=TOPICS)
    parser.add_argument("--rounds", type=int, default=3)
    chosen = parser.parse_args()
    print(table(chosen.old.resolve(), chosen.topics, chosen.rounds).markdown())
    return 0


if __name__ == "__main__":
    sys.exit(main())
