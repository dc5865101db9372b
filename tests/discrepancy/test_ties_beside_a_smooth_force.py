"""Terms that records need as much beside a smooth force are tied, whatever blocks lose with each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from impactcell.discrepancy.machine import MachineFinding, TermChoice
from impactcell.discrepancy.machine.finding import OpenLoopError
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.regression.trials import ChosenTerm, TermSearch, Trial
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.search.ties import needed_as_much
from impactcell.discrepancy.machine.simulation import tied_models
from impactcell.records import Samples
from tests.benchmarks._machine_study import run, task

DRAG, VISCOUS, SPRING = map(TermChoice, ("quadratic_drag", "viscous_friction", "restoring_force"))
MODEL: list[Column] = [("offset", 0.0, 0)]


@dataclass(frozen=True)
class Needs:
    """Stands for the evidence beside a smooth force: what is needed of each term is given."""

    of: Mapping[str, float]

    def beside(self, columns: Sequence[Column]) -> object:
        assert list(columns) == MODEL
        return lambda term, size: self.of[term[0][0]]


@dataclass(frozen=True)
class Search(TermSearch):
    """Stands for the search: what blocks gain of each term is given."""

    gains: Mapping[str, float] = None  # type: ignore[assignment]
    ends: frozenset[str] = frozenset()

    left: float = 1.1

    def losses(self, columns: Sequence[Column]) -> Samples:
        assert list(columns) == MODEL
        return np.ones(8)

    def gap(self, columns: Sequence[Column]) -> float:
        assert list(columns) == [*MODEL, ("quadratic_drag", 0.0, 0)]
        return self.left

    def best_shape(self, choice: TermChoice, columns: Sequence[Column], before: Samples) -> Trial:
        gains = np.full(8, self.gains[choice.name] / 8)
        return Trial(ChosenTerm(choice, 0.0), gains, gains, choice.name in self.ends)


def tied_with_drag(
    needs: Sequence[float], gains: Sequence[float], ends: frozenset[str] = frozenset(), left: float = 1.1
) -> tuple[str, ...]:
    choices = DRAG, VISCOUS, SPRING
    names = [choice.name for choice in choices]
    search = Search(
        None,  # type: ignore[arg-type]
        choices,
        dict.fromkeys(names, (0.0,)),
        {},
        frozenset(),
        Needs(dict(zip(names, needs, strict=True))),  # type: ignore[arg-type]
        dict(zip(names, gains, strict=True)),
        ends,
        left,
    )
    best = Trial(ChosenTerm(DRAG, 0.0), np.ones(8), np.ones(8), at_end=False)
    return needed_as_much(search, MODEL, best)


@pytest.mark.parametrize(
    ("needs", "gains", "tied"),
    [
        ((9.0, 6.5, -1.0), (1.0, 0.6, 0.9), ("viscous_friction",)),
        ((9.0, 12.0, 8.0), (1.0, 0.6, 0.6), ("viscous_friction", "restoring_force")),
        ((9.0, 5.9, -1.0), (1.0, 0.9, 0.9), ()),
        ((9.0, 8.0, -1.0), (1.0, 0.4, 0.9), ()),
        ((4.0, 2.9, -1.0), (1.0, 0.9, 0.9), ()),
    ],
    ids=["as much", "more", "a twentieth", "closes too little", "not needed"],
)
def test_a_term_is_tied_that_records_need_as_much(
    needs: Sequence[float], gains: Sequence[float], tied: tuple[str, ...]
) -> None:
    assert tied_with_drag(needs, gains) == tied


def test_a_shape_at_its_end_is_not_tied() -> None:
    assert tied_with_drag((9.0, 9.0, -1.0), (1.0, 1.0, 0.0), frozenset({"viscous_friction"})) == ()


def test_where_no_more_than_the_noise_is_left_blocks_tell() -> None:
    assert tied_with_drag((9.0, 9.0, -1.0), (1.0, 0.9, 0.0), left=1.0) == ()


@pytest.mark.slow
@pytest.mark.parametrize("number", [87, 155, 299])
def test_a_model_error_does_not_tell_two_terms_apart_falsely(number: int) -> None:
    """Blocks spoke for viscous friction for a drag, and for a straight spring for one that hardens."""
    row = run(task(number, 1_180_000))
    (name,) = row["established"]
    assert row["hidden"] in row["tied"][name]


@pytest.mark.slow
def test_a_drag_alone_is_tied_with_nothing() -> None:
    row = run(task(57, 1_180_000))
    assert row["hidden"] == "quadratic_drag"
    assert row["tied"] == {"quadratic_drag": []}


@pytest.mark.slow
@pytest.mark.parametrize(("times", "tied"), [(1.45, ["hardening_spring"]), (1.55, [])])
def test_a_term_that_simulates_held_out_records_worse_is_tied_no_more(
    times: float, tied: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As viscous friction of a real pendulum that air slows: 3.4 mrad off, 1.3 with a drag."""

    def worse(finding: MachineFinding, model: FittedModel) -> OpenLoopError:
        assert model is not finding.final
        return replace(finding.simulated[1], rmse=times * finding.simulated[1].rmse)

    monkeypatch.setattr(tied_models, "simulate_held_out", worse)
    row = run(task(87, 1_180_000))
    assert row["tied"] == {"restoring_force": tied}
    assert row["verdict"] == ("tied" if tied else "named")
