"""Journals of earlier versions are opened with all that they hold."""

import json
from pathlib import Path
from typing import Any

import pytest

from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import MODEL, STATE, upgraded_state
from impactcell.serialization.message_pack import unpack_tree
from impactcell.serialization.tree import to_tree
from tests.data.contents import described, stored, without_later_conditions
from tests.data.journals import FORMATS, copy_journal, what_was_read


@pytest.mark.parametrize(
    "how", [{"read_only": True}, {}, {"upgrade": upgraded_state}], ids=["read only", "as it is", "upgraded"]
)
@pytest.mark.parametrize("number", FORMATS)
def test_all_that_an_older_journal_holds_is_read(tmp_path: Path, number: int, how: dict[str, Any]) -> None:
    expected = what_was_read(number)
    journal = copy_journal(number, tmp_path / "j.sqlite")
    for _ in range(2):
        with Journal(journal, "press-1", **how) as opened:
            assert without_later_conditions(described(stored(opened), opened), expected) == expected


@pytest.mark.parametrize("number", FORMATS)
def test_a_journal_is_of_its_format_and_is_brought_up_to_this_one(tmp_path: Path, number: int) -> None:
    path = copy_journal(number, tmp_path / "j.sqlite")
    with Journal(path, "press-1", read_only=True) as journal:
        before = journal.state() or b""
        model = MODEL.loads(journal.model)
    assert unpack_tree(before).get("format", 3) == number
    with Journal(path, "press-1", upgrade=upgraded_state) as journal:
        after = journal.state() or b""
        assert MODEL.loads(journal.model) == model
    assert unpack_tree(after)["format"] == STATE.format
    assert (after == before) == (number == STATE.format)


def leaves(tree: Any) -> list[Any]:
    """Numbers and text of a tree in their order, without any names."""
    if isinstance(tree, dict):
        return [leaf for value in tree.values() for leaf in leaves(value)]
    if isinstance(tree, list | tuple):
        return [leaf for value in tree for leaf in leaves(value)]
    return [float.fromhex(tree) if isinstance(tree, str) and "0x" in tree else tree]


def test_the_model_of_an_older_journal_is_read(tmp_path: Path) -> None:
    path = copy_journal(3, tmp_path / "j.sqlite")
    with Journal(path, "press-1", read_only=True) as journal:
        as_written, model = journal.model, MODEL.loads(journal.model)
    expected = leaves(json.loads(as_written))
    assert len(expected) > 100
    assert leaves(to_tree(model)) == expected
