"""The exception tree is drawn once, and the drawing is true."""

import inspect

from impactcell import errors


def test_docstring_draws_every_class() -> None:
    classes = {
        name
        for name, cls in inspect.getmembers(errors, inspect.isclass)
        if issubclass(cls, errors.ImpactCellError)
    }
    drawn = {word for word in (errors.__doc__ or "").replace("─", " ").split() if word.endswith("Error")}
    assert classes == drawn
