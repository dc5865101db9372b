"""How many of its own taps a cell's first model is fitted to: more only while more may help."""

from types import SimpleNamespace
from typing import Any

import pytest

from impactcell.api.first_model import LARGEST_GAP, FirstModel
from impactcell.cli import first_model


@pytest.mark.parametrize(
    ("gap", "shortcomings", "expected"),
    [
        (1.0, ("k is not known well enough; strike more taps, and faster ones",), [30, 60, 120, 240]),
        (2.0 * LARGEST_GAP, ("the taps are off the model: something is missing in it",), [30]),
        (1.0, (), [30]),
    ],
)
def test_twice_as_many_are_fitted_only_while_they_may_mend_it(
    gap: float,
    shortcomings: tuple[str, ...],
    expected: list[int],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    asked: list[int] = []

    def taps(_config: Any, _campaign: Any, count: int) -> tuple[str, int]:
        asked.append(count)
        return "journal", count

    def fitted(count: Any, _name: str, _source: str) -> FirstModel:
        return FirstModel(SimpleNamespace(gap=gap), count, shortcomings)  # type: ignore[arg-type]

    monkeypatch.setattr(first_model, "_taps", taps)
    monkeypatch.setattr(first_model, "fit_first_model", fitted)
    config: Any = SimpleNamespace(name="press-1")
    assert first_model._fit(config, None, None).taps == expected[-1]
    assert asked == expected
    said = capsys.readouterr().err
    assert said.count("are not enough") == len(expected) - 1
