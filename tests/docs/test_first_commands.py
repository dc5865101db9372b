"""Whoever begins is told how the commands of the pages are found, before the first of them."""

from pathlib import Path

START = (Path(__file__).resolve().parents[2] / "docs" / "start.md").read_text(encoding="utf-8")


def test_the_first_page_says_where_commands_are_typed() -> None:
    place = START.index(". .venv/bin/activate")
    assert place > START.index("make install")
    for first in ("\nimpactcell ", "\npython -m "):
        assert place < START.index(first)
