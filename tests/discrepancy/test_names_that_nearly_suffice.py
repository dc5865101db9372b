"""A name that suffices but for a little falls to a free form if it is but the likeness of another law."""

from unittest.mock import patch

import pytest

from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.search import SearchContext, SelectionResult
from impactcell.discrepancy.workflow import DiscrepancyResult, hold_against_free_forms, investigate
from impactcell.physics.free_forms import FREE_FORMS
from tests.discrepancy.study import Job, campaign

LIBRARY = ("friction_patch", "viscous_friction")
FORCE = FREE_FORMS["free_force_over_position"].effect.equation


def _investigated(
    job: Job, multiples: tuple[float, ...], library: tuple[str, ...] = LIBRARY
) -> tuple[DiscrepancyResult, SelectionResult]:
    """Outcome, and what the search had named before free forms were asked."""
    asked: list[SelectionResult] = []

    def hold(context: SearchContext, selection: SelectionResult) -> SelectionResult:
        asked.append(selection)
        return hold_against_free_forms(context, selection)

    with (
        patch("impactcell.discrepancy.workflow.find_law", lambda *_: None),
        patch("impactcell.discrepancy.workflow.hold_against_free_forms", hold),
    ):
        found = investigate(campaign(job, multiples), seed=job.seed, library=library)
    (selection,) = asked
    assert selection.added == library[:1]
    assert not selection.remains
    return found, selection


def _job(hidden: tuple[str, ...], seed: int, shots: int = 16) -> Job:
    return Job("model_error", hidden, seed, target=2.0, shots=shots)


def _left(selection: SelectionResult) -> float:
    """RMS residual that the names leave [noise floors]."""
    assert selection.accepted is not None
    return float((selection.accepted.residual**2).mean()) ** 0.5


@pytest.mark.slow
@pytest.mark.parametrize("seed", [720_043, 720_045])
def test_a_pull_at_one_place_is_not_called_a_patch_of_friction(seed: int) -> None:
    """It leaves two to six hundredths of the noise, in which no effect of the library is seen."""
    found, selection = _investigated(_job(("magnetic_pull",), seed), (0.14,))
    assert 1.015 < _left(selection) < 1.1
    assert found.verdict == "unknown"
    outcome = result_document(found)
    assert outcome["outdone"] == {"effect": "friction_patch", "form": FORCE, "same_place": False}
    assert "Friction patch comes nearest" in outcome["headline"]


@pytest.mark.slow
def test_a_patch_stands_beside_an_error_of_the_model_that_leaves_as_much() -> None:
    found, selection = _investigated(_job(("friction_patch", "wandering_force"), 720_052), (0.5, 0.022))
    assert 1.03 < _left(selection) < 1.1
    assert found.verdict == "named"
    assert found.added == ("friction_patch",)


@pytest.mark.slow
def test_a_tilt_that_shows_in_the_friction_factors_stands_beside_a_form_that_follows_the_traces() -> None:
    """A curve over indentation takes more of what a model error leaves, and nothing of the tilt."""
    job = _job(("surface_tilt", "wandering_force"), 600_042, shots=40)
    found, selection = _investigated(job, (2.7132, 0.15), ("surface_tilt", "direction_asymmetry"))
    assert 1.015 < _left(selection) < 1.1
    assert found.verdict == "named"
    assert found.added == ("surface_tilt",)
