"""Machine code on disk is not used again once a source it was made of has changed."""

import os
import subprocess
import sys
from pathlib import Path

CALLEE = "from impactcell.numerics.jit import compiled\n\n@compiled\ndef inner(x):\n    return {} * x\n"
CALLER = (
    "from callee import inner\nfrom impactcell.numerics.jit import compiled\n\n"
    "@compiled\ndef outer(x):\n    return inner(x)\n\n"
    "print(outer(1.0), sum(outer.stats.cache_hits.values()))\n"
)


def run(directory: Path) -> list[str]:
    done = subprocess.run(
        [sys.executable, "caller.py"],
        cwd=directory,
        # Bytecode is told from its source by time and size, which a test below keeps.
        env={**os.environ, "NUMBA_CACHE_DIR": str(directory / "cache"), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


def test_an_edited_callee_is_compiled_anew(tmp_path: Path) -> None:
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "callee.py").write_text(CALLEE.format(2.0))
    assert run(tmp_path) == ["2.0", "0"]
    assert run(tmp_path) == ["2.0", "1"]
    (tmp_path / "callee.py").write_text(CALLEE.format(3.0))
    assert run(tmp_path) == ["3.0", "0"]


NAMED = (
    "from typing import NamedTuple\nfrom impactcell.numerics.jit import compiled\n\n"
    "class {0}(NamedTuple):\n    x: float\n\n"
    "@compiled\ndef outer(named):\n    return 2.0 * named.x\n\n"
    "if __name__ == '__main__':\n    import caller\n"
    "    print(caller.outer(caller.{0}(1.0)), sum(caller.outer.stats.cache_hits.values()))\n"
)


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
