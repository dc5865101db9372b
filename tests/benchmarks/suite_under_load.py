"""The test suite beside busy processes: `python -m tests.benchmarks.suite_under_load --runs 5 --load 20`.

Each of the busy processes counts for one in the load average; the processors are shared with the workers of
the suite. A run is green if pytest says so; what failed is printed. What comes behind `--` goes to pytest.
"""

import argparse
import multiprocessing
import os
import re
import subprocess
import sys
import time
from pathlib import Path

from tests.benchmarks.table import Table

ROOT = Path(__file__).resolve().parents[2]
SUITE = ("-n", "auto", "--maxprocesses", "4", "--dist", "worksteal", "-q", "-o", "timeout=3600")
"""As `make test` runs it, but that a test may take an hour before it counts as hanging."""
LAST_LINES = re.compile(r"^(FAILED|ERROR) .*|^.*\b(?:passed|failed|error)\b.* in .*$", re.MULTILINE)


def _be_busy() -> None:
    while True:
        sum(range(100_000))


def run(busy: int, arguments: list[str]) -> tuple[int, float, float, list[str]]:
    """Run the suite once; its exit code, how long it took in s, the load then, and what it said last."""
    others = [multiprocessing.Process(target=_be_busy, daemon=True) for _ in range(busy)]
    for process in others:
        process.start()
    began_s = time.monotonic()
    try:
        command = [sys.executable, "-m", "pytest", *SUITE, *arguments]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        load = os.getloadavg()[1]
    finally:
        for process in others:
            process.kill()
            process.join()
    said = [match[0] for match in LAST_LINES.finditer(done.stdout)]
    return done.returncode, time.monotonic() - began_s, load, said


def main() -> int:
    """Print the table; the exit code is 1 if a run was not green."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.suite_under_load", description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--load", type=int, default=20, help="busy processes beside the suite")
    parser.add_argument("arguments", nargs="*", help="for pytest, behind `--`")
    options = parser.parse_args()
    rows = []
    for number in range(1, options.runs + 1):
        code, took_s, load, said = run(options.load, options.arguments)
        print(f"run {number}:", *said, sep="\n  ", file=sys.stderr, flush=True)
        green = "green" if code == 0 else f"**{code}**"
        rows.append((f"{number}", green, f"{took_s / 60.0:.1f}", f"{load:.0f}", said[-1] if said else ""))
    note = f"{options.load} busy processes on {os.cpu_count()} processors; bar: green in each run."
    print(
        Table(
            "The suite under load", ("run", "result", "min", "load, 5 min", "pytest"), rows, note
        ).markdown()
    )
    return int(any(row[1] != "green" for row in rows))


if __name__ == "__main__":
    sys.exit(main())
