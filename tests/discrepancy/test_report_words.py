"""What figures and sentences of a report say."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from impactcell.discrepancy.data import ReplicateSpread
from impactcell.discrepancy.report import figures, german_sentences, machine_sentences, sentences
from impactcell.discrepancy.search.gap import Gap, Part
from impactcell.discrepancy.search.gap_measure import GapChange
from impactcell.german.findings import german_headline
from impactcell.german.parameters import parameter_words
from impactcell.physics.effect_names import as_title, identifier_of, in_words
from impactcell.physics.effects import LIBRARY
from impactcell.web.messages import Messages


def test_a_figure_names_the_setting_of_its_shot() -> None:
    shot = SimpleNamespace(number=7, velocity_m_s=0.02, mass_kg=1.5, direction=-1.0)
    assert figures._setting(shot, sentences, is_weighed=True) == "shot 7, 1200 mm/min, 1.5 kg, −"
    assert figures._setting(shot, sentences, is_weighed=False) == "shot 7, 1200 mm/min, −"
    bare = SimpleNamespace(number=7, velocity_m_s=math.nan, mass_kg=math.nan, direction=1.0)
    assert figures._setting(bare, sentences, is_weighed=True) == "shot 7, +"


def closing(before: Gap, after: Gap, low: float) -> SimpleNamespace:
    """What a validation says of a gap that is judged in both parts."""
    both = tuple(Part)
    change = GapChange(both, before, after, 0.0, low, 1.0, 0.001)
    return SimpleNamespace(held_out=change, gap_before=before.of(both), gap_after=after.of(both))


@pytest.mark.parametrize("ties", [(), ("quadratic_drag",)])
def test_a_tie_and_a_name_are_told_as_what_they_are(ties: tuple[str, ...]) -> None:
    result: Any = SimpleNamespace(
        validation=closing(Gap(3.0, 2.0), Gap(1.0, 1.0), low=0.99),
        conclusion=SimpleNamespace(
            verdict="tied" if ties else "named",
            established=("viscous_friction",),
            ties={"viscous_friction": ties},
            remaining=SimpleNamespace(explained=True),
        ),
    )
    said = sentences._conclusion(result)
    assert ("cannot tell apart" in said) is bool(ties)
    assert ("with it the held-out gap falls from 3.00 to 1.00" in said) is not bool(ties)


@pytest.mark.parametrize(
    ("effects", "english", "german"),
    [
        (["adhesion"], "Missing: adhesion; with it the", "Es fehlt: Haften beim Trennen;"),
        (
            ["adhesion", "surface_tilt"],
            "adhesion and surface tilt; with them",
            "Haften beim Trennen und Neigung des Tisches;",
        ),
        (
            ["adhesion", "surface_tilt", "hertz_contact"],
            "adhesion, surface tilt and Hertz contact; with them the held-out gap falls from 3.00 to 1.00",
            "Haften beim Trennen, Neigung des Tisches und hertzscher Kontakt; damit fällt die Abweichung",
        ),
    ],
)
def test_effects_are_told_in_a_row(effects: list[str], english: str, german: str) -> None:
    result: Any = SimpleNamespace(
        validation=closing(Gap(3.0, 2.0), Gap(1.0, 1.0), low=0.99),
        conclusion=SimpleNamespace(
            verdict="named",
            established=tuple(effects),
            ties=dict.fromkeys(effects, ()),
            remaining=SimpleNamespace(explained=True),
        ),
    )
    assert english in sentences._conclusion(result)
    document = {
        "verdict": "named",
        "effects": [{"effect": effect} for effect in effects],
        "gap": {"held_out": {"before": 3.0, "after": 1.0}},
    }
    assert german in german_headline(document)


def proposed(functional_form: str, listed: str = "") -> Any:
    """A law over a column of shots.csv, as a result has it."""
    form = SimpleNamespace(
        second="",
        covariates=("temperature_c",),
        is_between_shots=True,
        law_kind=None,
        effect=SimpleNamespace(equation="mu (1 + s(temperature_c))"),
    )
    gap = SimpleNamespace(of=lambda _: 2.0)
    return SimpleNamespace(
        law=SimpleNamespace(
            refused="",
            term=SimpleNamespace(form=form),
            change=SimpleNamespace(parts=(), before=gap, after=gap),
            proposed=SimpleNamespace(functional_form=functional_form, listed=listed),
        )
    )


@pytest.mark.parametrize(
    ("functional_form", "how"),
    [
        ("u", "in proportion to the temperature c"),
        ("1", "constant"),
        ("log(1+u/l)", "as log(1+u/l) of u, the temperature c"),
    ],
)
def test_a_law_is_told_as_one_would_say_it(functional_form: str, how: str) -> None:
    said = sentences._proposed(proposed(functional_form))
    assert said.startswith(f" With s in mu (1 + s(temperature_c)) {how}, a law that no library has, the fric")


@pytest.mark.parametrize(("acts_between", "is_beside"), [(True, True), (False, False)])
def test_a_law_that_may_be_one_of_those_given_is_not_said_to_be_in_no_library(
    acts_between: bool, is_beside: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What `--effects` gave and the search did not take was proposed as a law "that no library has"."""
    mine = SimpleNamespace(between=(lambda *_: None) if acts_between else None, laws={})
    monkeypatch.setattr(sentences, "LIBRARY", {**sentences.LIBRARY, "mine": mine})
    said = sentences._proposed(proposed("log(1+u/l)"))
    assert ("a law beside those that were given" in said) is is_beside
    assert ("a law that no library has" in said) is not is_beside


def test_a_law_of_the_library_is_told_by_its_name() -> None:
    said = sentences._proposed(proposed("u", "quadratic_drag"))
    assert ", quadratic drag, which is not named, the friction" in said
    assert "no library" not in said


@pytest.mark.parametrize(
    ("depends_on", "said"),
    [
        (
            ("velocity", "direction"),
            "more values of velocity, all else unchanged; what remains is in free slide",
        ),
        (("direction",), "the same settings again; what remains is in free slide"),
        ((), "the same settings again; what remains is in free slide"),
    ],
)
def test_nobody_is_asked_for_more_values_of_what_has_no_more(depends_on: tuple[str, ...], said: str) -> None:
    result: Any = SimpleNamespace(
        conclusion=SimpleNamespace(
            verdict="unknown", unconfirmed=(), remaining=SimpleNamespace(explained=False)
        ),
        replicates=ReplicateSpread(0.01, 9),
        unexplained=SimpleNamespace(phase="free_slide", depends_on=depends_on),
        per_kilogram=False,
        prepared=_prepared((1,) * 8 + (-1,) * 8),
    )
    assert sentences.next_step(result) == said


def _prepared(directions: tuple[int, ...], batches: tuple[str, ...] = ("",)) -> Any:
    return SimpleNamespace(
        excitation=SimpleNamespace(has_contact=True, unit="shots"),
        shots=tuple(SimpleNamespace(direction=direction) for direction in directions),
        batches=batches,
    )


@pytest.mark.parametrize(
    ("directions", "explained", "said", "german"),
    [
        ((1,) * 40, True, "about 22 taps from there: a tilt", "etwa 22 Stöße von dort: bis dahin"),
        ((1,) * 32 + (-1,) * 8, True, "nothing more; the gap", "nichts weiter; ob es so"),
        (
            (1,) * 32 + (-1,) * 8,
            False,
            "about 10 more taps in direction -1, of which there are few",
            "etwa 10 weitere Stöße in Richtung -1",
        ),
        (
            (1,) * 24 + (-1,) * 16,
            False,
            "the same settings again; what remains is between the shots",
            "dasselbe",
        ),
    ],
)
def test_taps_in_the_other_direction_are_asked_for_where_they_are_few(
    directions: tuple[int, ...], explained: bool, said: str, german: str
) -> None:
    """All taps in one direction: a tilt of 8 mrad was friction 5 % off, and "nothing more" to be measured."""
    result: Any = SimpleNamespace(
        conclusion=SimpleNamespace(
            verdict="no_gap" if explained else "unknown",
            unconfirmed=(),
            remaining=SimpleNamespace(explained=explained),
        ),
        replicates=ReplicateSpread(0.01, 9),
        unexplained=None if explained else SimpleNamespace(phase="between_shots", depends_on=("direction",)),
        per_kilogram=False,
        prepared=_prepared(directions),
    )
    assert said in sentences.next_step(result)
    assert german in german_sentences.next_step(result)


@pytest.mark.parametrize(
    ("batches", "said"),
    [
        (("",), "give the shots of each mass a batch of its own in shots.csv"),
        (("a", "b"), "more values of mass, all else unchanged; what remains is between the shots"),
    ],
)
def test_friction_that_goes_with_the_mass_is_asked_for_by_batches(
    batches: tuple[str, ...], said: str
) -> None:
    """Six masses were there, and "more values of mass" was the advice: it led in a circle."""
    result: Any = SimpleNamespace(
        conclusion=SimpleNamespace(
            verdict="unknown", unconfirmed=(), remaining=SimpleNamespace(explained=False)
        ),
        replicates=ReplicateSpread(0.01, 9),
        unexplained=SimpleNamespace(phase="between_shots", depends_on=("mass",)),
        per_kilogram=False,
        prepared=_prepared((1, -1) * 8, batches),
    )
    assert said in sentences.next_step(result)


def test_where_only_the_spread_between_shots_falls_no_gap_is_said_to_fall() -> None:
    """A vibration that the library lacks leaves the traces where they are."""
    parts = {"traces": 2.96, "friction_factors": 1.55}, {"traces": 2.96, "friction_factors": 0.98}
    result: Any = SimpleNamespace(
        validation=closing(Gap(2.96, 1.55), Gap(2.96, 0.98), low=-1e-9),
        conclusion=SimpleNamespace(
            verdict="named",
            established=("direction_asymmetry",),
            ties={},
            remaining=SimpleNamespace(explained=True),
        ),
    )
    said = sentences._conclusion(result)
    assert "gap falls" not in said
    assert "spread of the friction factors falls from 1.55 to 0.98 times that of replicates" in said
    assert "the traces stay at 2.96 noise floors" in said
    document: dict[str, Any] = {
        "verdict": "named",
        "effects": [{"effect": "direction_asymmetry"}],
        "gap": {
            "held_out": {"before": 2.96, "after": 2.96, "closed_ci95": [-1e-9, 1e-9]},
            "parts": {"held_out": dict(zip(("before", "after"), parts, strict=True))},
        },
    }
    auf_deutsch = german_headline(document)
    assert "fällt die Abweichung" not in auf_deutsch
    assert "zwischen Messungen vom 1,55-Fachen auf das 0,98-Fache der von Wiederholungen" in auf_deutsch
    assert "bleibt bei 2,96" in auf_deutsch


@pytest.mark.parametrize(("unit", "told"), [("shots", "etwa 4 Stöße mehr"), ("blocks", "etwa 4 Blöcke mehr")])
def test_what_is_missing_is_counted_in_its_own_unit_and_in_both_languages(unit: str, told: str) -> None:
    result: Any = SimpleNamespace(
        conclusion=SimpleNamespace(verdict="untested", missing_shots=4),
        prepared=SimpleNamespace(excitation=SimpleNamespace(unit=unit)),
        training=range(7),
        held_out=range(3),
        validation=SimpleNamespace(gap_before=2.5),
    )
    assert sentences.next_step(result).startswith(f"about 4 {unit} more")
    assert german_sentences.next_step(result).startswith(told)
    document = {
        "verdict": "untested",
        "headline": sentences._conclusion(result),
        "gap": {"held_out": {"before": 2.5, "after": 2.5}},
    }
    assert "7 to fit and 3 held out, about 4 more" in document["headline"]
    assert german_headline(document).startswith(
        "Die Messungen reichen für keine Aussage: 7 angepasst, 3 zurückgehalten, etwa 4 weitere sind nötig; "
        "Abweichung des Modells: 2,50."
    )


def test_a_gap_of_what_was_fitted_alone_is_told_as_such_in_both_languages() -> None:
    result: Any = SimpleNamespace(
        conclusion=SimpleNamespace(verdict="unknown", established=(), unconfirmed=()),
        validation=SimpleNamespace(gap_before=1.02, is_at_floor=True),
        selection=SimpleNamespace(outdone=None),
        unexplained=None,
    )
    document = {
        "verdict": "unknown",
        "headline": sentences._conclusion(result),
        "gap": {"held_out": {"before": 1.02, "after": 1.02}},
    }
    assert "what the training shots show and held-out ones do not" in document["headline"]
    assert german_headline(document).startswith(
        "Kein bekannter Effekt erklärt, was angepasste Messungen zeigen und zurückgehaltene nicht: "
        "Abweichung 1,02."
    )


def test_an_effect_is_called_as_one_writes_it_and_keeps_its_identifier() -> None:
    """Also in a headline, where it comes first: who it is named after has a capital, and keeps it."""
    for identifier in (*LIBRARY, "coulomb_friction"):
        assert identifier_of(in_words(identifier)) == identifier
    assert in_words("hunt_crossley_damping") == Messages("en").effect("hunt_crossley_damping")
    assert as_title(machine_sentences.phrase("coulomb_friction")) == "Coulomb friction"
    assert as_title(sentences.phrase("hunt_crossley_damping")) == "Hunt-Crossley damping"
    assert (
        parameter_words("stribeck_friction", "stribeck_velocity_m_s", "de")[0] == "Stribeck-Geschwindigkeit"
    )
