"""Every block of code in the documentation runs, and prints what the page says."""

import os
from pathlib import Path

import pytest

from tests.docs.snippets import run, snippets

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
INCLUDED = ("impactcell/physics/effects/README.md", "impactcell/scada/README.md", "CONTRIBUTING.md")
"""Pages that lie elsewhere; README itself is run by tests/integration/test_readme.py."""
PAGES = sorted(
    page
    for page in (*DOCS.rglob("*.md"), *(ROOT / name for name in INCLUDED))
    if not {"_build", "_generated"} & set(page.parts) and snippets(page)
)


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make a directory in which the pages' paths are right."""
    (tmp_path / "config").symlink_to(ROOT / "config")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    return tmp_path


def test_there_are_pages_with_code() -> None:
    assert {"notebook.md", "discrepancy.md", "start.md"} <= {page.name for page in PAGES}


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_does_what_it_says(page: Path, workspace: Path) -> None:
    for block, printed in run(page, workspace):
        assert block.printed in {None, printed}, f"{page.name}:{block.line} printed\n{printed}"
