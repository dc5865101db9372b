"""A file that has grown too long is two: it is split by meaning, never by packing lines."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 300
"""Lines of a file of the product or the simulator."""


@pytest.mark.parametrize("package", ["impactcell", "simulator"])
def test_no_file_is_too_long(package: str) -> None:
    lengths = {
        file.relative_to(ROOT).as_posix(): len(file.read_text(encoding="utf-8").splitlines())
        for file in (ROOT / package).rglob("*.py")
    }
    assert len(lengths) > 20
    assert {file: length for file, length in lengths.items() if length > LONGEST} == {}
