"""Journals of earlier versions are opened with all that they hold."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import MODEL, upgraded_state
from impactcell.serialization.tree import to_tree
from tests.data.contents import described, stored, without_later_conditions

DATA = Path(__file__).parents[2] / "data"


VERSIONS = ["journal-format-3"]


def copied(version: str, directory: Path) -> Path:
    path = directory / "j.sqlite"
    shutil.copy(DATA / f"{version}.sqlite", path)
    return path


@pytest.mark.parametrize(
    "how", [{"read_only": True}, {}, {"upgrade": upgraded_state}], ids=["read only", "as it is", "upgraded"]
)
@pytest.mark.parametrize("version", VERSIONS)
def test_all_that_an_older_journal_holds_is_read(tmp_path: Path, version: str, how: dict[str, Any]) -> None:
    expected = json.loads((DATA / f"{version}.json").read_text(encoding="utf-8"))
    journal = copied(version, tmp_path)
    for _ in range(2):
        with Journal(journal, "press-1", **how) as opened:
            assert without_later_conditions(described(stored(opened), opened), expected) == expected


def leaves(tree: Any) -> list[Any]:
    """Numbers and text of a tree in their order, without any names."""
    if isinstance(tree, dict):
        return [leaf for value in tree.values() for leaf in leaves(value)]
    if isinstance(tree, list | tuple):
        return [leaf for value in tree for leaf in leaves(value)]
    return [float.fromhex(tree) if isinstance(tree, str) and "0x" in tree else tree]


def test_the_model_of_an_older_journal_is_read(tmp_path: Path) -> None:
    path = copied("journal-format-3", tmp_path)
    with Journal(path, "press-1", read_only=True) as journal:
        as_written, model = journal.model, MODEL.loads(journal.model)
    expected = leaves(json.loads(as_written))
    assert len(expected) > 100
    assert leaves(to_tree(model)) == expected
