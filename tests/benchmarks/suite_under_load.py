"""The test suite beside busy processes: `python -m tests.benchmarks.suite_under_load --runs 5 --load 20`.

Each of the busy processes counts for one in the load average; the processors are shared with the workers of
the suite. A run is green if pytest says so; what failed is printed. What comes behind `--` goes to pytest.

All that pytest said is kept in `--keep DIR`, a file for each run.

With `--together` the runs go side by side and are each other's load (five of three workers each are a load of
15; `--load 5` makes it 20). Each has a clone of the last commit of its own, so that runs do not meet in
files, and the same installed packages; and a loopback of its own where that can be had (`unshare`, as root),
so that they do not meet at a port either: each demo prefers the registered one.
"""

import argparse
import contextlib
import filecmp
import multiprocessing
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from tests.benchmarks.table import Table

ROOT = Path(__file__).resolve().parents[2]
SUITE = ("-n", "auto", "--maxprocesses", "4", "--dist", "worksteal", "-v", "-o", "timeout=3600")
"""As `make test` runs it, but that each test is told as it ends, and may take an hour before it counts as
hanging."""
INSTALLED = ("tests/interop/node/node_modules", "tests/browser/node_modules")
"""Foreign programs that `.ci/run` installs beside the tests; without them those tests skip."""
LOOK_S = 30.0
"""How often the load is looked at."""
ALONE = ("unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh")
"""Begins a command with a loopback of its own."""
LAST_LINES = re.compile(r"^(FAILED|ERROR) .*|^.*\b(?:passed|failed|error)\b.* in .*$", re.MULTILINE)


def _be_busy() -> None:
    while True:
        sum(range(100_000))


@contextlib.contextmanager
def _load(busy: int) -> Iterator[None]:
    """So many busy processes, for as long as the suite runs."""
    others = [multiprocessing.Process(target=_be_busy, daemon=True) for _ in range(busy)]
    for process in others:
        process.start()
    try:
        yield
    finally:
        for process in others:
            process.kill()
            process.join()


@dataclass(frozen=True)
class Run:
    """How one run of the suite ended."""

    exit_code: int
    took_s: float
    load: float
    output: str

    @property
    def last_lines(self) -> list[str]:
        """What failed, and how many of each there were."""
        return [match[0].strip("= ") for match in LAST_LINES.finditer(self.output)]


def _alone() -> tuple[str, ...]:
    """`ALONE`, where this machine and user can."""
    able = shutil.which("unshare") and subprocess.run([*ALONE, "true"], capture_output=True, check=False)
    return ALONE if able and able.returncode == 0 else ()


def run(arguments: list[str], log: Path, checkout: Path = ROOT, before: tuple[str, ...] = ()) -> Run:
    """Run the suite once; what it says goes to a file."""
    began_s = time.monotonic()
    command = [*before, sys.executable, "-m", "pytest", *SUITE, *arguments]
    # a summary line is cut at the terminal's width, and the reason with it
    environment = os.environ | {"PYTHONPATH": str(checkout), "COLUMNS": "400"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # as `make test` does
    with log.open("w", encoding="utf-8") as said:
        process = subprocess.Popen(
            command, cwd=checkout, env=environment, stdout=said, stderr=subprocess.STDOUT
        )
        loads = [os.getloadavg()[0]]
        while process.poll() is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(LOOK_S)
            loads.append(os.getloadavg()[0])
    took_s = time.monotonic() - began_s
    return Run(process.returncode, took_s, statistics.median(loads), log.read_text(encoding="utf-8"))


def run_in_clone(arguments: list[str], log: Path) -> Run:
    """Run the suite once in a clone of the last commit, which goes away afterwards."""
    with tempfile.TemporaryDirectory(prefix="suite-") as directory:
        checkout = Path(directory) / "checkout"
        subprocess.run(["git", "clone", "-q", str(ROOT), str(checkout)], check=True)
        # the README's commands are run there with what is installed here, and was after these were written
        (checkout / ".venv").symlink_to(sys.prefix)
        for packages in INSTALLED:
            if (ROOT / packages).is_dir():
                (checkout / packages).symlink_to(ROOT / packages)
        _keep_compiled(checkout)
        return run(arguments, log, checkout, _alone())


def _keep_compiled(checkout: Path) -> None:
    """Spare a clone what has been installed and compiled here: both are known by when a file was written."""
    for copy in checkout.rglob("*"):
        here = ROOT / copy.relative_to(checkout)
        if copy.is_file() and here.is_file() and filecmp.cmp(here, copy, shallow=False):
            shutil.copystat(here, copy)
    for compiled in ROOT.glob("[!.]*/**/__pycache__"):
        if "node_modules" not in compiled.parts:
            shutil.copytree(compiled, checkout / compiled.relative_to(ROOT))


def main() -> int:
    """Print the table; the exit code is 1 if a run was not green."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.suite_under_load", description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--load", type=int, default=20, help="busy processes beside the suite")
    parser.add_argument("--together", action="store_true", help="the runs side by side, each in a clone")
    parser.add_argument("--keep", type=Path, help="directory for what pytest said")
    parser.add_argument("arguments", nargs="*", help="for pytest, behind `--`")
    options = parser.parse_args()
    rows = []
    one_run, at_once = (run_in_clone, options.runs) if options.together else (run, 1)
    with tempfile.TemporaryDirectory(prefix="suite-") as directory:
        keep = options.keep or Path(directory)
        keep.mkdir(parents=True, exist_ok=True)
        logs = [keep / f"run-{number}.log" for number in range(1, options.runs + 1)]
        with _load(options.load), ThreadPoolExecutor(at_once) as runs:
            results = list(runs.map(one_run, [options.arguments] * options.runs, logs))
    for number, done in enumerate(results, 1):
        said = done.last_lines
        print(f"run {number}:", *said, sep="\n  ", file=sys.stderr, flush=True)
        green = "green" if done.exit_code == 0 else f"**{done.exit_code}**"
        last = said[-1] if said else ""
        rows.append((f"{number}", green, f"{done.took_s / 60.0:.1f}", f"{done.load:.0f}", last))
    order = "side by side, each in a clone" if options.together else "one after the other"
    note = f"Runs {order}; {options.load} busy processes on {os.cpu_count()} processors; "
    note += "bar: green in each run."
    print(
        Table(
            "The suite under load", ("run", "result", "min", "load, median", "pytest"), rows, note
        ).markdown()
    )
    return int(any(row[1] != "green" for row in rows))


if __name__ == "__main__":
    sys.exit(main())
