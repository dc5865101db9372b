"""Machine code on disk is not used again once a source it was made of has changed."""

import ctypes
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from impactcell.numerics import jit

CALLEE = "from impactcell.numerics.jit import compiled\n\n@compiled\ndef inner(x):\n    return {} * x\n"
CALLER = (
    "from callee import inner\nfrom impactcell.numerics.jit import compiled\n\n"
    "@compiled\ndef outer(x):\n    return inner(x)\n\n"
    "print(outer(1.0), sum(outer.stats.cache_hits.values()))\n"
)


def start(directory: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "caller.py"],
        cwd=directory,
        # Bytecode is told from its source by time and size, which a test below keeps.
        env={**os.environ, "NUMBA_CACHE_DIR": str(directory / "cache"), "PYTHONDONTWRITEBYTECODE": "1"},
        stdout=subprocess.PIPE,
        text=True,
    )


def run(directory: Path, processes: int = 1) -> list[str]:
    """Give what processes that begin together print, in the order of what they say."""
    started = [start(directory) for _ in range(processes)]
    printed = [process.communicate()[0] for process in started]
    assert [process.returncode for process in started] == [0] * processes
    return " ".join(sorted(printed)).split()


@pytest.mark.slow
def test_of_two_processes_one_compiles_and_an_edited_callee_is_compiled_anew(tmp_path: Path) -> None:
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "callee.py").write_text(CALLEE.format(2.0))
    assert run(tmp_path, 2) == ["2.0", "0", "2.0", "1"]
    (tmp_path / "callee.py").write_text(CALLEE.format(3.0))
    assert run(tmp_path) == ["3.0", "0"]


@pytest.mark.slow
def test_what_is_compiled_into_its_callers_is_compiled_anew_with_them(tmp_path: Path) -> None:
    callee = CALLEE.replace("compiled", "inlined")
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "callee.py").write_text(callee.format(2.0))
    assert run(tmp_path) == ["2.0", "0"]
    assert run(tmp_path) == ["2.0", "1"]
    (tmp_path / "callee.py").write_text(callee.format(3.0))
    assert run(tmp_path) == ["3.0", "0"]


TOLD = (
    "from impactcell.numerics.compilation import on_compilation\non_compilation(lambda: print('compiling'))\n"
)


@pytest.mark.slow
def test_that_machine_code_is_missing_is_told_once_and_only_then(tmp_path: Path) -> None:
    (tmp_path / "caller.py").write_text(TOLD + CALLER)
    (tmp_path / "callee.py").write_text(CALLEE.format(2.0))
    assert run(tmp_path) == ["compiling", "2.0", "0"], "of two functions"
    assert run(tmp_path) == ["2.0", "1"]


NAMED = (
    "from typing import NamedTuple\nfrom impactcell.numerics.jit import compiled\n\n"
    "class {0}(NamedTuple):\n    x: float\n\n"
    "@compiled\ndef outer(named):\n    return 2.0 * named.x\n\n"
    "if __name__ == '__main__':\n    import caller\n"
    "    print(caller.outer(caller.{0}(1.0)), sum(caller.outer.stats.cache_hits.values()))\n"
)


@pytest.mark.slow
def test_a_class_that_was_renamed_since_is_compiled_anew(tmp_path: Path) -> None:
    """The index on disk names the classes of the arguments, and reading it looks them up."""
    (tmp_path / "caller.py").write_text(NAMED.format("Before"))
    assert run(tmp_path) == ["2.0", "0"]
    assert run(tmp_path) == ["2.0", "1"]
    written = (tmp_path / "caller.py").stat()
    (tmp_path / "caller.py").write_text(NAMED.format("Afterw"))
    os.utime(tmp_path / "caller.py", ns=(written.st_atime_ns, written.st_mtime_ns))
    assert run(tmp_path) == ["2.0", "0"]
    assert run(tmp_path) == ["2.0", "1"]


def is_free(file: Path) -> bool:
    with file.open("rb") as other:
        return jit._is_locked(other)


def test_a_turn_ends_with_those_on_its_way_that_were_never_given_back(tmp_path: Path) -> None:
    """What is tried on the way and cannot be compiled is never written, so nothing gives its turn back."""
    caller, callee = tmp_path / "caller.py", tmp_path / "callee.py"
    for file in (caller, callee):
        file.write_text("")
    turns = jit._Turns()
    turns.take("outer", str(caller))
    turns.take("beside it, in the same file", str(caller))
    turns.give_back("beside it, in the same file")
    turns.take("not to be compiled", str(callee))
    assert not is_free(caller)
    assert not is_free(callee)
    turns.give_back("outer")
    assert is_free(caller)
    assert is_free(callee)


def test_who_waits_too_long_compiles_as_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit, "MOST_LOOKS", 0)
    file = tmp_path / "caller.py"
    file.write_text("")
    first, second = jit._Turns(), jit._Turns()
    first.take("here", str(file))
    second.take("there", str(file))
    second.give_back("there")
    assert not is_free(file)
    first.give_back("here")
    assert is_free(file)


@pytest.mark.slow
def test_without_a_place_for_a_cache_it_still_runs(tmp_path: Path) -> None:
    source = (
        "from impactcell.numerics.jit import _can_cache, compiled\n\n"
        "@compiled\ndef twice(x):\n    return 2.0 * x\n\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", source + "print(twice(1.0), _can_cache(twice.py_func))"],
        cwd=tmp_path,
        env=dict(os.environ),
        capture_output=True,
        text=True,
        check=True,
    )
    # A function typed in on the command line has no file beside which anything could be kept.
    assert done.stdout.split() == ["2.0", "False"]


def test_a_law_that_divides_by_zero_gives_infinity_and_writes_nothing(
    capfd: pytest.CaptureFixture[str],
) -> None:
    names: dict[str, jit.Law] = {}
    exec(
        "def law(a, b, c, d, parameters):\n    return 1.0 - 2.0 / a\n", names
    )  # has no file, and so no cache
    number = ctypes.c_double
    law = ctypes.CFUNCTYPE(number, *[number] * 4, ctypes.POINTER(number))(jit.address(names["law"]))
    assert law(0.0, 0.0, 0.0, 0.0, (number * 1)()) == -math.inf
    assert law(4.0, 0.0, 0.0, 0.0, (number * 1)()) == 0.5
    assert capfd.readouterr().err == ""
