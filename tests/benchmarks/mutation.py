"""Single faults put into the code: how many of them a test of the same room notices.

Mutants are drawn with a seed; each is put into a copy of the tree, and only the tests of its room run, until
the first that fails. A mutant is a line of a file, and is not tried twice.
`python -m tests.benchmarks.mutation ROOM NUMBER` tries so many of a room; the topic prints what is on file.
"""

import argparse
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Final

from tests.benchmarks._mutants import Mutant, mutants
from tests.benchmarks.table import Table

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "bench-results" / "mutation.jsonl"
SEED = 20261122
LONGEST_S = 300.0
"""A mutant whose tests take longer hangs, and counts as noticed."""
ROOMS: Final[dict[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "cell": (("impactcell/cell/*.py",), ("tests/unit/cell", "tests/unit/service/test_worker.py")),
    "journal": (("impactcell/journal/*.py",), ("tests/unit/journal",)),
    "intake": (
        ("impactcell/service/worker.py", "impactcell/service/journal_writer.py"),
        ("tests/unit/service", "tests/unit/journal"),
    ),
    "fieldbus": (
        ("impactcell/fieldbus/*.py", "impactcell/fieldbus/transports/*.py"),
        ("tests/unit/fieldbus",),
    ),
    "tracking": (("impactcell/tracking/*/*.py",), ("tests/unit/tracking", "tests/unit/cell")),
    "prediction": (("impactcell/prediction/*.py",), ("tests/unit/prediction",)),
    "discrepancy": (
        ("impactcell/discrepancy/*.py", "impactcell/discrepancy/*/*.py"),
        ("tests/discrepancy",),
    ),
    "scada access": (
        ("impactcell/scada/users.py", "impactcell/opcua/trust_list.py", "impactcell/opcua/secure_channel.py"),
        (
            "tests/unit/opcua",
            "tests/integration/test_opcua_identity.py",
            "tests/integration/test_opcua_rights.py",
        ),
    ),
}  # fmt: skip
"""What is mutated, and the tests that have to notice."""


def drawn(room: str) -> list[tuple[Path, Mutant]]:
    """All mutants of a room in the order in which they are tried."""
    patterns, _ = ROOMS[room]
    files = sorted(file for pattern in patterns for file in ROOT.glob(pattern))
    every = [(file.relative_to(ROOT), m) for file in files for m in mutants(file.read_text(encoding="utf-8"))]
    random.Random(f"{SEED} {room}").shuffle(every)
    return every


def on_file() -> list[dict[str, Any]]:
    """What has been tried."""
    return [json.loads(line) for line in RESULTS.read_text().splitlines()] if RESULTS.exists() else []


def attempt(room: str, number: int) -> None:
    """Try the next mutants of a room, so many."""
    tried = {(row["file"], row["line"], row["before"], row["after"]) for row in on_file()}
    with tempfile.TemporaryDirectory() as directory:
        tree = Path(directory)
        for part in ("impactcell", "simulator", "tests", "config", "docs"):
            ignored = shutil.ignore_patterns("__pycache__", "_build")
            shutil.copytree(ROOT / part, tree / part, ignore=ignored)
        for part in ("pyproject.toml", "README.md", "CHANGELOG.md"):
            shutil.copy(ROOT / part, tree / part)
        if not _passes(tree, ROOMS[room][1]):
            sys.exit(f"the tests of {room} do not pass as they are")
        for file, mutant in drawn(room):
            key = str(file), mutant.line, mutant.before, mutant.text
            if number <= 0 or key in tried:
                continue
            number -= 1
            source = (ROOT / file).read_text(encoding="utf-8")
            (tree / file).write_text(mutant.applied(source), encoding="utf-8")
            killed = not _passes(tree, ROOMS[room][1])
            (tree / file).write_text(source, encoding="utf-8")
            row = dict(zip(("file", "line", "before", "after"), key, strict=True))
            RESULTS.parent.mkdir(exist_ok=True)
            with RESULTS.open("a") as out:
                out.write(json.dumps({"room": room, **row, "killed": killed}) + "\n")
            print(f"{'killed' if killed else 'SURVIVED'} {key}", file=sys.stderr, flush=True)


def _passes(tree: Path, tests: tuple[str, ...]) -> bool:
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider", *tests]
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        run = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, timeout=LONGEST_S, check=False
        )
    except subprocess.TimeoutExpired:
        return False
    return run.returncode == 0


def interval(killed: int, tried: int) -> str:
    """Wilson's interval of a share, 95 %."""
    share, z2 = killed / tried, 1.96**2
    middle = (share + z2 / (2 * tried)) / (1.0 + z2 / tried)
    half = math.sqrt(z2 * (share * (1.0 - share) + z2 / (4 * tried)) / tried) / (1.0 + z2 / tried)
    return f"{100 * (middle - half):.0f} to {100 * (middle + half):.0f} %"


def tables() -> list[Table]:
    """How many of the mutants on file were noticed, by room."""
    rows = []
    for room in ROOMS:
        results = [row["killed"] for row in on_file() if row["room"] == room]
        size = len(drawn(room))
        if results:
            killed = sum(results)
            text = f"{100 * killed / len(results):.0f} % ({killed} of {len(results)})"
            rows.append((room, f"{size}", ">= 90 %", text, interval(killed, len(results))))
        else:
            rows.append((room, f"{size}", ">= 90 %", "not tried", ""))
    return [
        Table(
            "Single faults in the code that a test of the same room notices",
            ("room", "possible", "bar", "noticed", "interval (95 %)"),
            rows,
            f"Drawn with seed {SEED} from comparisons, operators, constants, conditions, calls and results.",
        )
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.mutation", description=__doc__)
    parser.add_argument("room", choices=ROOMS)
    parser.add_argument("number", type=int)
    arguments = parser.parse_args()
    attempt(arguments.room, arguments.number)
