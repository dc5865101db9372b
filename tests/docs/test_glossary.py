"""One word, one meaning: in the glossary, and in the names of the code."""

import re
from pathlib import Path

import pytest

from tests.benchmarks import _syntax
from tests.benchmarks.structure import DEFINITIONS, definitions, glossary, homes, retired_names, twice_listed

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def product() -> list[_syntax.Module]:
    return _syntax.modules(ROOT, "impactcell")


def test_each_word_is_listed_once() -> None:
    words, retired = glossary(ROOT)
    assert len(words) > 60
    assert twice_listed(words).items == ()
    assert not set(words) & set(retired)


def test_a_word_listed_twice_is_seen() -> None:
    assert twice_listed(["shot", "cycle", "Shot"]).items == ("shot",)


@pytest.mark.slow
def test_no_retired_name_is_left(product: list[_syntax.Module]) -> None:
    _, retired = glossary(ROOT)
    assert len(retired) > 40
    assert retired_names(product, retired).items == ()


def test_a_retired_name_is_seen(tmp_path: Path) -> None:
    (tmp_path / "impactcell" / "room").mkdir(parents=True)
    (tmp_path / "impactcell" / "room" / "file.py").write_text("class Tracked:\n    def odds(self): ...\n")
    seen = retired_names(_syntax.modules(tmp_path, "impactcell"), ["Tracked", "odds", "room.file"])
    assert len(seen.items) == 3


@pytest.mark.slow
def test_what_the_structure_table_looks_for_is_still_there(product: list[_syntax.Module]) -> None:
    for row, patterns in DEFINITIONS.items():
        assert definitions(product, patterns).value > 0, row
        for pattern in patterns:
            names = {node.name for home in homes(product, pattern) for node in _syntax.functions(home)}
            # a definition whose module stands, but which is gone from it, may have been renamed: look
            found = [name for name in names if re.fullmatch(pattern.split(":")[1], name)]
            assert found or not names, pattern
