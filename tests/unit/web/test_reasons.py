"""Published reasons are said in German where the page speaks German."""

import json
from dataclasses import replace

import pytest

from impactcell.prediction.equations import beyond_calibration
from impactcell.web.cell_view import CellView
from impactcell.web.interface import CellNews
from impactcell.web.texts.reasons import german_reason
from tests.snapshots import make_capture, make_snapshot
from tests.unit.prediction.test_estimate import GOOD, MODEL

ENGLISH = {
    "is",
    "the",
    "outside",
    "of",
    "not",
    "recorded",
    "times",
    "noise",
    "calibrated",
    "being",
    "through",
}


def words(text: str) -> set[str]:
    return set(text.replace(",", " ").replace(";", " ").split())


def test_what_lies_outside_the_calibration_is_said_in_german() -> None:
    far = replace(GOOD, mass_kg=40.0, velocity_m_s=0.5)
    reason = beyond_calibration(MODEL, far, 0.4)
    assert len(reason.split("; ")) == 3
    german = german_reason(reason)
    assert "Masse 40 kg liegt außerhalb des Kalibrierten, 18,9 bis 18,9 kg" in german
    assert "µs 0,4 liegt außerhalb" in german
    assert not words(german) & ENGLISH


@pytest.mark.parametrize(
    ("english", "german"),
    [
        ("the reference is being learned, 12 more cycles",
         "der Vergleich wird noch gelernt, 12 weitere Zyklen"),
        ("from the module's summary: no force was recorded",
         "aus der Zusammenfassung des Moduls: Kraft wurde nicht aufgezeichnet"),
        ("residuals are 2.31 times the sensors' noise: the model lacks something",
         "die Abweichung ist 2,31-mal das Rauschen der Sensoren: dem Modell fehlt etwas"),
        ("what nobody has translated; in place", "what nobody has translated; am Ziel"),
        ("", ""),
    ],
)  # fmt: skip
def test_a_sentence(english: str, german: str) -> None:
    assert german_reason(english) == german


def test_a_card_has_both_languages() -> None:
    snapshot = make_snapshot(make_capture(3))
    mu_s = replace(snapshot.friction.mu_s, reason="no position was recorded")
    view = CellView("press-1")
    view.take(CellNews("press-1", replace(snapshot, friction=replace(snapshot.friction, mu_s=mu_s))))
    reasons = json.loads(view.encode("card"))["reasons"]
    assert reasons["en"]["mu_s"] == "no position was recorded"
    assert reasons["de"]["mu_s"] == "Position wurde nicht aufgezeichnet"
    assert reasons["en"].keys() == reasons["de"].keys()
