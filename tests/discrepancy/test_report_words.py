"""What figures and sentences of a report say."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from impactcell.discrepancy.report import figures, sentences
from impactcell.german.findings import german_headline


def test_a_figure_names_the_setting_of_its_shot() -> None:
    shot = SimpleNamespace(number=7, velocity_m_s=0.02, mass_kg=1.5, direction=-1.0)
    assert figures._setting(shot, sentences) == "shot 7, 1200 mm/min, 1.5 kg, −"
    assert (
        figures._setting(
            SimpleNamespace(number=7, velocity_m_s=math.nan, mass_kg=math.nan, direction=1.0), sentences
        )
        == "shot 7, +"
    )


@pytest.mark.parametrize("ties", [(), ("quadratic_drag",)])
def test_a_tie_and_a_name_are_told_as_what_they_are(ties: tuple[str, ...]) -> None:
    result: Any = SimpleNamespace(
        validation=SimpleNamespace(gap_before=3.0, gap_after=1.0),
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
            "adhesion, surface tilt and hertz contact; with them the held-out gap falls from 3.00 to 1.00",
            "Haften beim Trennen, Neigung des Tisches und Hertzscher Kontakt; damit fällt die Abweichung",
        ),
    ],
)
def test_effects_are_told_in_a_row(effects: list[str], english: str, german: str) -> None:
    result: Any = SimpleNamespace(
        validation=SimpleNamespace(gap_before=3.0, gap_after=1.0),
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
        conclusion=SimpleNamespace(verdict="unknown", remaining=SimpleNamespace(explained=False)),
        unexplained=SimpleNamespace(phase="free_slide", depends_on=depends_on),
    )
    assert sentences.next_step(result) == said
