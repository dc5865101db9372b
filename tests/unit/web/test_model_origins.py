"""What was established as a model was found is told on the page in its language."""

from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.cli.model_origin import CAUTIONS, VERDICTS, origin_of
from impactcell.german.findings import GERMAN_PHASES
from impactcell.prediction import REMAINS
from impactcell.settings.model_file import read_model
from impactcell.web.messages import Messages
from tests.integration.processes import CONFIG

MODEL: Path = CONFIG / "models" / "prototype.yaml"


def caution(**provenance: str) -> str:
    origin = origin_of(replace(read_model(MODEL), provenance=provenance))
    assert origin is not None
    return origin.caution


@pytest.mark.parametrize("verdict", VERDICTS)
def test_each_verdict_is_said_in_either_language(verdict: str) -> None:
    english, german = (Messages(language).verdict(verdict) for language in ("en", "de"))
    assert english
    assert german
    assert english != german


def test_of_no_verdict_nothing_is_said() -> None:
    assert Messages("de").verdict(None) == ""
    assert Messages("en").verdict("made up") == ""


@pytest.mark.parametrize("verdict", CAUTIONS)
def test_each_caution_is_said_in_german(verdict: str) -> None:
    language, german = Messages("de").caution(caution(verdict=verdict))
    assert language == "de"
    assert german.startswith("Nichts ist nachgewiesen: ")
    assert Messages("en").caution(CAUTIONS[verdict]) == ("en", CAUTIONS[verdict])


@pytest.mark.parametrize(
    ("remains", "said"),
    [
        ("12% of the held-out gap", "12 % der Abweichung zurückgehaltener Stöße. Das"),
        ("a pattern, in loading, free slide", "ein Muster (Phase: Belasten, freies Gleiten). Das"),
    ],
)
def test_what_remains_is_said_in_german(remains: str, said: str) -> None:
    language, german = Messages("de").caution(caution(verdict="named", **{REMAINS: remains}))
    assert language == "de"
    assert f"erklärt: {said} kann verfälschen" in german


@pytest.mark.parametrize("phase", GERMAN_PHASES)
def test_every_phase_in_which_something_may_remain_has_a_german_name(phase: str) -> None:
    told = caution(verdict="named", **{REMAINS: f"a pattern, in {phase.replace('_', ' ')}"})
    assert f"(Phase: {GERMAN_PHASES[phase]})" in Messages("de").caution(told)[1]
