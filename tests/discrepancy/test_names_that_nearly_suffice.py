"""A name that suffices but for a little falls to a free form if it is but the likeness of another law."""

from unittest.mock import patch

import pytest

from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.search import SearchContext, SelectionResult
from impactcell.discrepancy.workflow import DiscrepancyResult, hold_against_free_forms, investigate
from impactcell.physics.free_forms import FREE_FORMS
from tests.discrepancy.study import Job, campaign

FORCE = FREE_FORMS["free_force_over_position"].effect.equation


def _investigated(
    hidden: tuple[str, ...], multiples: tuple[float, ...], seed: int
) -> tuple[DiscrepancyResult, SelectionResult]:
    """Outcome, and what the search had named before free forms were asked."""
    asked: list[SelectionResult] = []

    def hold(context: SearchContext, selection: SelectionResult) -> SelectionResult:
        asked.append(selection)
        return hold_against_free_forms(context, selection)

    job = Job("model_error", hidden, seed, target=2.0, shots=16)
    with (
        patch("impactcell.discrepancy.workflow.find_law", lambda *_: None),
        patch("impactcell.discrepancy.workflow.hold_against_free_forms", hold),
    ):
        found = investigate(
            campaign(job, multiples), seed=seed, library=("friction_patch", "viscous_friction")
        )
    (selection,) = asked
    assert selection.added == ("friction_patch",)
    assert not selection.remains
    return found, selection


@pytest.mark.slow
@pytest.mark.parametrize("seed", [720_043, 720_045])
def test_a_pull_at_one_place_is_not_called_a_patch_of_friction(seed: int) -> None:
    """It leaves two to six hundredths of the noise, in which no effect of the library is seen."""
    found, selection = _investigated(("magnetic_pull",), (0.14,), seed)
    assert 1.01 < (selection.accepted.residual**2).mean() ** 0.5 < 1.1  # type: ignore[union-attr]
    assert found.verdict == "unknown"
    outcome = result_document(found)
    assert outcome["outdone"] == {"effect": "friction_patch", "form": FORCE, "same_place": False}
    assert "Friction patch comes nearest" in outcome["headline"]


@pytest.mark.slow
def test_a_patch_stands_beside_an_error_of_the_model_that_leaves_as_much() -> None:
    found, selection = _investigated(("friction_patch", "wandering_force"), (0.5, 0.022), 720_052)
    assert 1.03 < (selection.accepted.residual**2).mean() ** 0.5 < 1.1  # type: ignore[union-attr]
    assert found.verdict == "named"
    assert found.added == ("friction_patch",)
