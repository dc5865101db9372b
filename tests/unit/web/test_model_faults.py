"""A model that is refused is told on the page in its language, from what `model accept` says."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell.cli.model_origin import untold_sentence
from impactcell.cli.own_taps import OwnTaps
from impactcell.errors import PredictionError
from impactcell.physics import TapInput
from impactcell.prediction import calibrate
from impactcell.settings.model_file import read_model
from impactcell.web.messages import Messages

COMMAND = "impactcell model accept '/srv/my cell.yaml' /srv/studies/7/results/model.extended.yaml --anyway"


def refusal(own: OwnTaps, model: str = "oil") -> str:
    return f"press-1: model {model} is not put into service (`{COMMAND}` would): {own.sentence}"


def test_both_figures_and_the_way_out_are_said_in_either_language() -> None:
    told = refusal(OwnTaps(30, 1.0, 7.123, 30, 2))
    language, german = Messages("de").fault(told)
    assert language == "de"
    assert german == (
        "press-1: Modell oil wird nicht übernommen, denn die eigenen Stöße der Zelle sprechen dagegen: "
        "bei den letzten 30 lässt es das 7,12-Fache des Sensorrauschens übrig, 2 Schätzungen sind "
        "brauchbar; das jetzige Modell lässt nicht mehr als das Sensorrauschen übrig, 30 sind es. Sind die "
        f"Messungen aus dieser Zelle? Soll das Modell dennoch gelten: „{COMMAND}“."
    )
    language, english = Messages("en").fault(told)
    assert language == "en"
    assert (
        "of the last 30 it leaves 7.12 times the sensors' noise, 2 estimates are usable; the model in"
        in english
    )
    assert "the model in service leaves no more than the sensors' noise, 30 are. Were" in english
    assert english.endswith(f"“{COMMAND}” takes it.")


def test_what_was_stored_of_a_refusal_is_said_too() -> None:
    told = refusal(OwnTaps(30, 1.0, 7.123, 30, 2)).replace(f"`{COMMAND}`", "--anyway")
    told = told.replace("no more than", "1 times")
    german = Messages("de").fault(told)[1]
    assert "das jetzige Modell lässt nicht mehr als das Sensorrauschen übrig, 30 sind es." in german
    assert german.endswith("„impactcell model accept --anyway“.")


def test_the_model_is_called_by_its_effects_in_words() -> None:
    told = refusal(OwnTaps(30, 1.0, 7.123, 30, 2), "prototype + surface_tilt")
    assert "Modell prototype + Neigung des Tisches wird nicht" in Messages("de").fault(told)[1]


@pytest.mark.parametrize(
    ("language", "said"), [("en", "it can follow none"), ("de", "kann es keinem folgen")]
)
def test_taps_that_no_model_follows_are_said_to_be_such(language: str, said: str) -> None:
    assert said in Messages(language).fault(refusal(OwnTaps(5, math.nan, math.nan, 5, 1)))[1]


def test_a_model_whose_contact_nothing_tells_is_refused_in_either_language() -> None:
    model = read_model(Path("config/models/prototype.yaml"))
    wide = replace(model, prior=replace(model.prior, stiffness_std_n_per_m=2.5e10, ratio_std=0.4))
    why = untold_sentence(wide, model.prior)
    fault = f"press-1: model oil is not put into service (`{COMMAND}` would): {why}"
    language, german = Messages("de").fault(fault)
    assert language == "de"
    assert german.startswith(
        "press-1: Modell oil wird nicht übernommen: seine Messungen zeigen nicht, wie groß k "
    )
    assert "± 5e+10 N/m und µk/µs " in german
    assert "± 0,8 ist (± gilt zu 95 %)" in german
    assert german.endswith(f"„{COMMAND}“.")
    english = Messages("en").fault(fault)[1]
    assert "its measurements do not tell k " in english
    assert english.endswith(f"“{COMMAND}” takes it.")


@pytest.mark.parametrize(
    ("stroke_m", "way_out"),
    [(0.0015, "es braucht schnellere Stöße oder"), (0.3, "es braucht Stöße ab etwa 40000 mm/min oder einen")],
)
def test_a_model_with_which_no_part_slides_free_is_refused_in_german(stroke_m: float, way_out: str) -> None:
    """An effect that makes a contact soft: the German page told it in English."""
    plant = replace(read_model(Path("config/models/prototype.yaml")).plant, stiffness_n_per_m=100.0)
    tap = TapInput(velocity_m_s=0.1, mass_kg=20.0, stroke_m=stroke_m)
    with pytest.raises(PredictionError) as refused:
        calibrate(plant, tap, [9.45, 37.8], np.linspace(0.03, 0.1, 17), np.linspace(0.15, 0.25, 3))
    language, german = Messages("de").fault(str(refused.value))
    assert language == "de"
    assert german.startswith("Mit diesem Modell kommt kein Teil von 9,45 bis 37,8 kg zwischen 1800 und 6000 ")
    assert way_out in german
    assert "With this model no part of 9.45 to 37.8 kg" in Messages("en").fault(str(refused.value))[1]
