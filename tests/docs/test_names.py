"""Files and modules that pages and docstrings name are there."""

import ast
import re
from pathlib import Path

import pytest

from tests.benchmarks.structure import glossary

ROOT = Path(__file__).resolve().parents[2]
FILE = re.compile(r"`((?:[\w.-]+/)*\w+\.py)`")
MODULE = re.compile(r"`((?:impactcell|simulator|tests)(?:\.\w+)+)`")
LOGGERS = {"impactcell.audit"}
"""Dotted names that are of no module."""
PAGES = [
    *(page for page in (ROOT / "docs").rglob("*.md") if not {"_generated", "_build"} & set(page.parts)),
    *(ROOT / "impactcell").rglob("README.md"),
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "tests/data/README.md")),
]
FILES = [
    path.relative_to(ROOT).as_posix()
    for folder in ("impactcell", "simulator", "tests", "docs")
    for path in (ROOT / folder).rglob("*.py")
]
SOURCES = [*(ROOT / "impactcell").rglob("*.py"), *(ROOT / "simulator").rglob("*.py")]


def docstrings(path: Path) -> str:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    return "\n".join(ast.get_docstring(node) or "" for node in ast.walk(tree) if isinstance(node, kinds))


def is_there(name: str) -> bool:
    """Whether a file of this name, with the folders it is given, is in the tree."""
    return any(f"/{file}".endswith(f"/{name}") for file in FILES)


def exists(dotted: str) -> bool:
    """Whether a dotted name leads to a module, a folder or a name in a module."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        place = ROOT.joinpath(*parts[:count])
        if place.is_dir() or place.with_suffix(".py").is_file():
            rest = parts[count:]
            source = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
            if not rest or not source.is_file():
                return not rest
            return re.search(rf"\b{rest[0]}\b", source.read_text(encoding="utf-8")) is not None
    return False


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_names_files_that_are_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert [name for name in FILE.findall(text) if not is_there(name)] == []
    assert [name for name in MODULE.findall(text) if name not in LOGGERS and not exists(name)] == []


@pytest.mark.slow
def test_docstrings_name_what_is_there() -> None:
    gone = []
    for path in SOURCES:
        text = docstrings(path)
        names = [name for name in FILE.findall(text) if not is_there(name)]
        names += [name for name in MODULE.findall(text) if not exists(name)]
        gone += [f"{path.relative_to(ROOT)}: {name}" for name in names]
    assert gone == []


@pytest.mark.slow
def test_docstrings_use_no_retired_type() -> None:
    _, retired = glossary(ROOT)
    typed = re.compile(
        rf"^\s*[\w, ]+ : .*\b({'|'.join(name for name in retired if name[0].isupper())})\b", re.MULTILINE
    )
    assert typed.search("    tap : Strike\n")
    gone = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in SOURCES
        for match in typed.finditer(docstrings(path))
    ]
    assert gone == []


def test_the_table_of_opcua_has_a_row_for_each_module() -> None:
    room = ROOT / "impactcell" / "opcua"
    rows = re.findall(r"^`(\w+)` {2,}", docstrings(room / "__init__.py"), re.MULTILINE)
    assert sorted(rows) == sorted(path.stem for path in room.rglob("*.py") if path.stem != "__init__")


def test_a_name_that_is_gone_is_seen() -> None:
    assert not is_there("no_such_room/pipeline.py")
    assert not exists("impactcell.tracking.honesty")
    assert exists("impactcell.cell.pipeline.step")
    assert not exists("impactcell.cell.pipeline.leap")
