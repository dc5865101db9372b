"""The exception tree is drawn once, and the drawing is true."""

import ast
import inspect
import re
from pathlib import Path

import pytest

from impactcell import errors


def test_docstring_draws_every_class() -> None:
    classes = {
        name
        for name, cls in inspect.getmembers(errors, inspect.isclass)
        if issubclass(cls, errors.ImpactCellError)
    }
    tree, _, _ = (errors.__doc__ or "").partition("Outside the tree")
    drawn = {word for word in tree.replace("─", " ").split() if word.endswith("Error")}
    assert classes == drawn


@pytest.mark.slow
def test_docstring_names_what_stands_outside_the_tree() -> None:
    _, _, outside = (errors.__doc__ or "").partition("Outside the tree")
    package = Path(errors.__file__).parent
    classes = {
        node.name
        for path in package.rglob("*.py")
        if path != Path(errors.__file__)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
        and any(re.fullmatch(r"(Base)?Exception|\w+Error", ast.unparse(base)) for base in node.bases)
    }
    assert classes == set(re.findall(r"\w+Error", outside))
