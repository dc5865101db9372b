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
        env={**os.environ, "NUMBA_CACHE_DIR": str(directory / "cache")},
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
