"""README's lines of results are what the stored tables say."""

import re
from dataclasses import replace

import pytest

from tests.benchmarks.headlines import HEADLINES, README, block, lines, read, written


def test_readme_says_what_the_tables_say() -> None:
    text = README.read_text(encoding="utf-8")
    assert block() in text, "run `python -m tests.benchmarks.headlines --write`"
    assert written(text) == text


def test_there_are_five_and_every_number_comes_from_a_table() -> None:
    assert len(HEADLINES) == len(lines()) == 5
    for text, cells in HEADLINES:
        assert set(re.findall(r"\{(\w+)\}", text)) == set(cells)


def test_another_result_makes_another_line(monkeypatch: pytest.MonkeyPatch) -> None:
    text = README.read_text(encoding="utf-8").replace("0.958", "0.900")
    assert block() not in text
    assert "0.958" in written(text)


def test_a_table_that_is_gone_is_an_error() -> None:
    (cell, *_) = HEADLINES[0][1].values()
    for wrong in (replace(cell, title="No such"), replace(cell, row="no such")):
        with pytest.raises(LookupError):
            read(wrong)


def test_readme_is_short() -> None:
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 150
