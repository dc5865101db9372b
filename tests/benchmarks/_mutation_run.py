"""Tests of a room, with a fault or without, in a process forked off one that has the libraries loaded.

The fault is put into the module as it is imported; no file is changed. A process that a test starts runs
without it: what only such a process would notice counts as not noticed.
"""

import functools
import importlib.machinery
import json
import os
import sys
import threading
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, Final

ROOT = Path(__file__).resolve().parents[2]
LIBRARIES: Final = (
    "pytest", "_pytest.assertion.rewrite", "hypothesis.internal.conjecture.engine", "numpy",
    "scipy.optimize", "scipy.stats", "scipy.signal", "scipy.integrate", "scipy.interpolate", "scipy.linalg",
    "numba", "pandas", "matplotlib.figure", "pydantic", "yaml", "asyncua", "pymodbus.client",
    "cryptography.x509", "filterpy.kalman", "jinja2",
)  # fmt: skip
"""Loaded once for all faults: what neither the product nor a test is part of."""


def put_in(file: str, source: str, compiled: frozenset[str]) -> None:
    """Let a module be imported with another source; machine code of `compiled` is made anew and not kept."""
    path = str(ROOT / file)
    get_code = importlib.machinery.SourceFileLoader.get_code

    def changed(self: importlib.machinery.SourceFileLoader, name: str) -> CodeType | None:
        return compile(source, path, "exec") if self.path == path else get_code(self, name)

    importlib.machinery.SourceFileLoader.get_code = changed  # type: ignore[assignment,method-assign]
    if compiled:
        from impactcell.numerics import jit

        can_cache = jit._can_cache
        jit._can_cache = lambda function: function.__name__ not in compiled and can_cache(function)


class Profile:
    """Plugin of pytest: how long each test takes, and the functions of a room that it goes through.

    What the setup of a test goes through counts for all tests of its file: a fixture may be shared.
    """

    def __init__(self, files: tuple[str, ...]) -> None:
        self._names = {str(ROOT / file): file for file in files}
        self._through: set[tuple[str, str]] = set()
        self.tests: dict[str, dict[str, Any]] = defaultdict(lambda: {"s": 0.0, "through": set()})
        self.shared: dict[str, set[tuple[str, str]]] = defaultdict(set)

    def _enter(self, frame: FrameType, _event: str, _argument: object) -> None:
        code = frame.f_code
        if code.co_filename in self._names:
            self._through.add((self._names[code.co_filename], code.co_qualname))

    def pytest_runtest_logstart(self) -> None:
        """Watch: a test may have taken the watch away."""
        sys.settrace(self._enter)
        threading.settrace(self._enter)

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Keep what a part of a test went through."""
        test = self.tests[report.nodeid]
        test["s"] += report.duration
        test["through"] |= self._through
        if report.when == "setup":
            self.shared[report.nodeid.split("::")[0]] |= self._through
        self._through = set()

    def write(self, path: Path) -> None:
        """Write what is known of all tests."""
        tests = {
            name: {"s": test["s"], "through": sorted(test["through"] | self.shared[name.split("::")[0]])}
            for name, test in self.tests.items()
        }
        path.write_text(json.dumps(tests))


def run(
    tests: tuple[str, ...], prepare: Callable[[], None], profile: tuple[tuple[str, ...], Path] | None
) -> None:
    """Run tests up to the first that fails; the process ends with pytest's code."""
    silence = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(silence, stream)
    os.chdir(ROOT)
    sys.path.insert(0, str(ROOT))
    prepare()
    import pytest

    plugins = [Profile(profile[0])] if profile else []
    arguments = [
        "-q",
        "-n0",
        "-p",
        "no:cacheprovider",
        "-W",
        "ignore::pytest.PytestAssertRewriteWarning",
        *tests,
    ]
    code = pytest.main(arguments if profile else ["-x", *arguments], plugins)
    if profile and code == 0:
        plugins[0].write(profile[1])
    os._exit(code)


def with_fault(tests: tuple[str, ...], file: str, source: str, compiled: frozenset[str]) -> None:
    """Process: run tests with a fault."""
    run(tests, functools.partial(put_in, file, source, compiled), None)


def as_it_is(tests: tuple[str, ...], files: tuple[str, ...], path: Path) -> None:
    """Process: run tests, and write what they go through."""
    run(tests, lambda: None, (files, path))
