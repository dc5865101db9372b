"""The first minutes: from a fresh clone to the first mu_s, from a second start of the service to a cycle.

`python -m tests.benchmarks.first_minutes starts` leaves the clone out; `clone` leaves the starts out. The
clone is of what is committed here; what it needs is installed anew, without a cache of packages.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from tests.benchmarks._load import _told, cell_file, modules
from tests.benchmarks.table import Table
from tests.integration.processes import ROOT

STARTS = 5
"""Starts of the service after the first one."""
PERIOD_S = 0.1
"""Between two cycles of the module, which always has one ready, s."""
FIRST_CYCLE = r"mu_s [0-9]\.\d+ ± "
"""What the service says at `--verbose` of each cycle that it has published."""
PAGE = r"page at (http\S+): user "
FIRST_OF_DEMO = r"cycle \d+: mu_s [0-9]"
"""What the demo says of its page and of each cycle."""
COLUMNS = ("what", "bar", "measured", "interval")


@dataclass(frozen=True)
class Start:
    """One start of the service, from its command to its first published cycle.

    Attributes
    ----------
    ready_s : float
        Until its endpoint listens.
    first_cycle_s : float
        Until its first cycle is published.
    cpu_s : float
        Processor time until then.
    """

    ready_s: float
    first_cycle_s: float
    cpu_s: float


def start(file: Path, log: Path) -> Start:
    """Start the service of one cell, and stop it after its first cycle."""
    began_s = time.monotonic()
    with log.open("w") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "impactcell", "run", "--verbose", str(file)], stderr=out, cwd=ROOT
        )
    try:
        _told(log, r" at (opc\.tcp://\S+)", process)
        ready_s = time.monotonic() - began_s
        _told(log, f"({FIRST_CYCLE})", process)
        first_s = time.monotonic() - began_s
        spent = psutil.Process(process.pid).cpu_times()
        return Start(ready_s, first_s, spent.user + spent.system)
    finally:
        process.terminate()
        process.wait()


def starts(number: int) -> list[tuple[str, str, str, str]]:
    """Rows of a first start, with whatever is compiled already, and of so many after it."""
    with tempfile.TemporaryDirectory() as temporary, modules(1, PERIOD_S) as (port,):
        directory = Path(temporary)
        file = cell_file(directory, "cell", port, 0, journal=True)
        start(file, directory / "service.log")
        runs = [start(file, directory / "service.log") for _ in range(number)]
    first_s, ready_s, cpu_s = np.array([(run.first_cycle_s, run.ready_s, run.cpu_s) for run in runs]).T
    return [
        (
            "second start of the service to its first cycle",
            "<= 3 s",
            f"{np.median(first_s):.2f} s",
            f"{first_s.min():.2f}-{first_s.max():.2f} s of {number}; processor {np.median(cpu_s):.2f} s",
        ),
        ("to its endpoint", "", f"{np.median(ready_s):.2f} s", f"{ready_s.min():.2f}-{ready_s.max():.2f} s"),
    ]


def clone() -> list[tuple[str, str, str, str]]:
    """Row of the README's first command in a fresh clone, until its first mu_s."""
    with tempfile.TemporaryDirectory() as temporary:
        directory = Path(temporary)
        environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        environment |= {"PIP_NO_CACHE_DIR": "1", "UV_NO_CACHE": "1", "HOME": temporary}
        environment.pop("VIRTUAL_ENV", None)
        python = Path(sys.executable).resolve()
        began_s = time.monotonic()
        subprocess.run(["git", "clone", "--quiet", str(ROOT), "clone"], cwd=directory, check=True)
        make = [shutil.which("make") or "make", f"PYTHON={python}"]
        subprocess.run([*make, "install"], cwd=directory / "clone", env=environment, check=True)
        installed_s = time.monotonic() - began_s
        demo = subprocess.Popen(
            [*make, "--silent", "demo", "ARGS=--cycles 1"],
            cwd=directory / "clone", env=environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        assert demo.stdout is not None
        page_s, first_s = None, None
        for line in demo.stdout:
            if page := re.match(PAGE, line):
                with urllib.request.urlopen(page[1], timeout=60) as answer:
                    assert "password" in answer.read().decode()
                page_s = time.monotonic() - began_s
            elif re.match(FIRST_OF_DEMO, line):
                first_s = time.monotonic() - began_s
        assert demo.wait() == 0
        assert page_s, "the demo told no page"
        assert first_s, "the demo told no mu_s"
    return [
        (
            "fresh clone to the first mu_s, packages not cached",
            "<= 90 s",
            f"{first_s:.0f} s",
            f"one run; clone and install {installed_s:.0f} s",
        ),
        ("fresh clone to the live page, open to log in", "<= 120 s", f"{page_s:.0f} s", "the same run"),
    ]


def table(rows: list[tuple[str, str, str, str]]) -> Table:
    """Table of these rows."""
    return Table(
        "The first minutes",
        COLUMNS,
        rows,
        "One cell on a module that always has a cycle ready; what is compiled is on disk. Clone: `make demo` "
        "until it tells its first mu_s; the system's own package of Python is there already.",
    )


def tables(quick: bool = False) -> list[Table]:
    """Measure starts, and the clone unless `quick`."""
    return [table(starts(2) if quick else [*starts(STARTS), *clone()])]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("starts", "clone"))
    print(table(starts(STARTS) if parser.parse_args().what == "starts" else clone()).markdown())
