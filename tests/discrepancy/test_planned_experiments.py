"""How a page tells what to measure next: once for several ties, added to what there is, in what limits."""

import math
from types import SimpleNamespace
from typing import Any, cast

import pytest

from impactcell.discrepancy.data import CellLimits
from impactcell.discrepancy.report import german_sentences, sentences
from impactcell.discrepancy.report.page import report_environment
from impactcell.discrepancy.report.planned_experiments import lacks_limits, planned_experiments
from impactcell.discrepancy.search import UNLIMITED, Proposal

BOTH_WAYS = "1400 mm/min, 25.2 kg, half of them in each direction"
TILT = ("surface_tilt", "direction_asymmetry")
LEVEL = "level the table with a spirit level, and do the same again: what is left then is no tilt"


def result(
    *proposals: Proposal, limits: CellLimits = UNLIMITED, batches: tuple[str, ...] = ("A", "B")
) -> Any:
    shots = tuple(SimpleNamespace(record=number, batch=number % len(batches)) for number in range(1, 8))
    prepared = SimpleNamespace(shots=shots, batches=batches)
    return cast("Any", SimpleNamespace(experiments=proposals, prepared=prepared, limits=limits))


def told(found: Any, said: Any) -> str:
    """The part of a page that says what to measure next."""
    environment = report_environment(said)
    name = {"en": "report.html.j2", "de": "report.de.html.j2"}["en" if said is sentences else "de"]
    source, _, _ = cast("Any", environment.loader).get_source(environment, name)
    part = source[source.index("{% for row in proposals %}") : source.index('<div class="figures">')]
    return environment.from_string(part).render(
        proposals=planned_experiments(found, said.told_apart),
        lacks_limits=lacks_limits(found),
        setting=said.setting,
        next_step="",
    )


def test_one_experiment_for_three_ties_is_told_once_and_as_added() -> None:
    pairs = (TILT, ("surface_tilt", "batch_shift"), ("friction_drift", "batch_shift"))
    found = result(
        *(Proposal(pair, BOTH_WAYS, 12, power) for pair, power in zip(pairs, (0.97, 0.92, 0.99), strict=True))
    )
    page = told(found, sentences)
    assert page.count("Measure next") == 1
    assert (
        "to tell surface tilt from direction asymmetry and from batch shift, and friction drift from batch "
        f"shift: {BOTH_WAYS}, 12 shots added to this campaign, in batch B (92 % sure to tell)."
    ) in page
    german = told(found, german_sentences)
    assert german.count("Als Nächstes messen") == 1
    assert (
        "1400 mm/min, 25,2 kg, je die Hälfte in jeder Richtung, 12 Stöße zusätzlich zu dieser Messung, "
        "in Charge B (mit 92 % Wahrscheinlichkeit entscheidend)."
    ) in german


@pytest.mark.parametrize("limits", [UNLIMITED, CellLimits(max_velocity_m_s=0.1)])
def test_without_a_cell_the_page_says_that_no_limits_were_considered(limits: CellLimits) -> None:
    found = result(Proposal(TILT, BOTH_WAYS, 12, 0.95), limits=limits)
    is_unknown = limits == UNLIMITED
    assert ("No limits of a cell were considered" in told(found, sentences)) is is_unknown
    assert ("Grenzen einer Zelle sind nicht" in told(found, german_sentences)) is is_unknown


def test_of_a_measurement_that_is_no_shot_no_number_is_told() -> None:
    found = result(Proposal(TILT, LEVEL, 0, math.nan), batches=("A",))
    for said in (sentences, german_sentences):
        page = told(found, said)
        assert "%" not in page
        assert "--cell" not in page


def test_a_batch_that_is_repeated_is_not_told_twice() -> None:
    found = result(Proposal(("friction_drift", "batch_shift"), "batch A again, after the others", 6, 0.93))
    assert "batch A again, after the others, 6 shots added to this campaign (93 %" in told(found, sentences)
