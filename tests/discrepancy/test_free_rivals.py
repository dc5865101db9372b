"""Named effects held against free forms: what a smooth force of no name leaves is not named after it."""

from unittest.mock import patch

import pytest

from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from tests.discrepancy.study import Job, campaign

SHOTS = 16
LIBRARY = ("hertz_contact", "friction_patch", "periodic_friction", "force_sensor_gain")
"""What may be named: the effect that is hidden, and what is drawn to a remainder."""


def _investigated(hidden: tuple[str, ...], multiples: tuple[float, ...], seed: int) -> DiscrepancyResult:
    job = Job("model_error", hidden, seed, target=2.0, shots=SHOTS)
    with patch("impactcell.discrepancy.workflow.find_law", lambda *_: None):
        return investigate(campaign(job, multiples), seed=seed, library=LIBRARY)


def test_an_effect_is_named_beside_a_force_of_which_nobody_knows_the_form() -> None:
    found = _investigated(("force_sensor_gain", "wandering_force"), (1.0, 0.15), 600_000)
    assert found.added == ("force_sensor_gain",)
    assert found.verdict == "named"
    assert not found.conclusion.remaining.explained
    assert found.validation.gap_after < found.validation.gap_before


@pytest.mark.parametrize("seed", [600_000])
def test_a_force_of_which_nobody_knows_the_form_is_named_after_nothing(seed: int) -> None:
    found = _investigated(("wandering_force",), (0.2,), seed)
    assert found.verdict == "unknown"
    assert found.added == ()
