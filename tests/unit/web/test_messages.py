"""One catalogue: every text in every language, every text in use, every use with a text."""

import math
import re
from pathlib import Path

import pytest

import impactcell.web
from impactcell.alarms import EventKind, Refusal
from impactcell.cli.model_origin import VERDICTS
from impactcell.german.findings import GERMAN_PHASES, GERMAN_STEPS
from impactcell.physics.effect import Phase
from impactcell.physics.effects import LIBRARY
from impactcell.quantities import FOLDERS
from impactcell.records import Estimator, Quality
from impactcell.scada import Role
from impactcell.web.alarm_pages import ACTIONS
from impactcell.web.interface import Freshness
from impactcell.web.messages import Messages
from impactcell.web.page_context import THEMES
from impactcell.web.past import SPANS_S
from impactcell.web.studies.study import Stage
from impactcell.web.texts import CATALOGUE, LANGUAGES
from tests.unit.web.page import make_page

ROOM = Path(impactcell.web.__file__).parent


def sources(*patterns: str) -> str:
    return "\n".join(path.read_text() for pattern in patterns for path in ROOM.glob(pattern))


def test_every_text_is_there_in_every_language() -> None:
    for key, texts in CATALOGUE.items():
        assert len(texts) == len(LANGUAGES), key
        assert all(text.strip() for text in texts), key


def test_every_condition_role_theme_and_span_has_a_name() -> None:
    messages = Messages("de")
    for key in (
        *(role.name.lower() for role in Role),
        *(f"theme_{theme}" for theme in THEMES),
        *(f"span_{span}" for span in SPANS_S),
    ):
        assert messages[key]
    assert EventKind.ACKNOWLEDGE in ACTIONS.values()


def test_no_text_is_left_over_or_missing() -> None:
    everything = sources("templates/*.j2", "*.py", "studies/*.py", "static/*.js")
    asked = set(re.findall(r't\["(\w+)"\]|t\[\'(\w+)\'\]', sources("templates/*.j2")))
    assert {a or b for a, b in asked} <= set(CATALOGUE) | {
        "theme_",
        "span_",
        "stage_",
        "did_",
        "all_",
        "exposed_",
    }
    scripts = sources("static/*.js")
    assert set(re.findall(r"texts\.(\w+)", scripts)) <= set(Messages("en").for_script())
    by_name = {
        *(f"theme_{theme}" for theme in THEMES),
        *(f"span_{span}" for span in SPANS_S),
        *(f"live_{quality.name.lower()}" for quality in Quality),
        *(f"live_{estimator.value}" for estimator in Estimator),
        *(f"folder_{folder}" for folder in FOLDERS),
        *(f"stage_{stage.value}" for stage in Stage),
        *(f"live_{freshness.value}" for freshness in Freshness),
        *(f"refused_{refusal.value}" for refusal in Refusal),
        *(f"verdict_{verdict}" for verdict in VERDICTS),
        *("exposed_users", "exposed_key", "exposed_read", "exposed_write", "exposed_read_write"),
        *("refused_BadInvalidArgument", "refused_BadOutOfRange", "refused_other"),
        *(
            "did_accept",
            "did_restore",
            "all_mass",
            "all_velocity",
            "all_stroke",
            "all_rate",
            *(role.name.lower() for role in Role),
        ),
    }
    for key in CATALOGUE:
        word = key.removeprefix("live_")
        generated = key in by_name
        assert generated or re.search(rf"\b{word}\b", everything), f"{key} is not used"


@pytest.mark.parametrize(("accepts", "language"), [("de-DE,de;q=0.9", "de"), ("fr", "en"), ("", "en")])
async def test_the_browser_says_which_language(tmp_path: Path, accepts: str, language: str) -> None:
    page = make_page(tmp_path)
    async with page.client() as client:
        text = (await client.get("/login", headers={"accept-language": accepts})).text
        assert f'<html lang="{language}"' in text
        assert Messages(language)["password"] in text
        assert '<html lang="de"' in (await client.get("/login?lang=de")).text
        assert '<html lang="de"' in (await client.get("/login")).text  # it remembers
        assert '<html lang="de"' in (await client.get("/login?lang=xx")).text


def test_a_refusal_is_a_sentence_and_never_what_the_address_says() -> None:
    codes = [code.value for code in Refusal]
    assert codes
    for code in codes:
        if code not in ("BadInvalidState", "BadConditionAlreadyEnabled", "BadConditionAlreadyDisabled"):
            assert Messages("en").refusal(code) != Messages("en")["refused_other"], code
    assert Messages("de").refusal("call 555-0100") == Messages("de")["refused_other"]


def test_every_effect_and_every_step_is_said_in_german() -> None:
    assert all(
        effect.german is not None and all(map(str.strip, effect.german)) for effect in LIBRARY.values()
    )
    program = "\n".join(path.read_text() for path in ROOM.parent.rglob("*.py"))
    steps = set(re.findall(r'report_step\("([^"]+)"\)', program))
    assert len(steps) > 5
    assert steps <= set(GERMAN_STEPS)
    assert {phase.value for phase in Phase} == set(GERMAN_PHASES)


GAP = {"held_out": {"before": 8.784, "after": 1.07}}
FOUND = {
    "verdict": "named",
    "headline": "Missing: quadratic drag.",
    "effects": [{"effect": "quadratic_drag", "meaning": "m", "look_at": "l"}],
    "gap": GAP,
    "remaining": {"explained": True},
}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({}, "Es fehlt: Quadratischer Widerstand; damit fällt die Abweichung von 8,78 auf 1,07."),
        ({"effects": [{"effect": "quadratic_drag", "tied_with": ["viscous_friction"]}]},
         "Quadratischer Widerstand oder viskose Reibung (diese Messungen unterscheiden es nicht)"),
        ({"remaining": {"explained": False, "share": 0.12, "where": [{"phase": "stop"}]}},
         "12 % der Abweichung bleiben (Phase: Stillstand)."),
        ({"verdict": "no_gap"}, "Das Modell erklärt die Messungen: Abweichung 8,78."),
        ({"verdict": "unknown", "unexplained": {"phase": "free_slide"}},
         "Kein bekannter Effekt erklärt die Abweichung von 8,78 (Phase: freies Gleiten)."),
        ({"verdict": "unknown", "unexplained": {"phase": "free_slide"}, "blocks": {"held_out": 8}},
         "Kein bekannter Effekt erklärt die Abweichung von 8,78. (Abweichungen"),
        ({"verdict": "untested",
          "remaining": {"hints": ["coulomb_friction", "viscous_friction", "load_dependent_friction"]}},
         ("doch ist die Stärke von 0 verschieden (Coulombsche Reibung, viskose Reibung oder lastabhängige "
         "Reibung). Länger, mit weniger Rauschen oder mit größerer Bewegung aufzeichnen.")),
        ({"verdict": "unknown", "unconfirmed": ["mass_error"]}, "Falsche Masse würde"),
        ({"verdict": "unknown",
          "outdone": {"effect": "friction_patch", "form": "mu (1 + s(x))", "same_place": True}},
         "aber eine freie Funktion s, mu (1 + s(x)), folgt an derselben Stelle besser: Das Gesetz"),
        ({"verdict": "unknown",
          "outdone": {"effect": "friction_patch", "form": "-x' s", "same_place": False}},
         "-x' s, erklärt ebenso viel"),
        ({"verdict": "unknown", "outdone": None}, "Kein bekannter Effekt erklärt die Abweichung von 8,78."),
        ({"verdict": "untested"}, "reichen für keine Aussage"),
        ({"law": {"equation": "m x'' = s(v)"}}, "passt dazu: m x'' = s(v)."),
        ({"gap": {}}, "Missing: quadratic drag."),
    ],
)  # fmt: skip
def test_what_was_found_is_said_in_german(change: dict[str, object], said: str) -> None:
    result = FOUND | change
    assert said in Messages("de").headline(result)
    assert Messages("en").headline(result) == "Missing: quadratic drag."
    assert Messages("en").advice(FOUND["effects"][0]) == ("m", "l")  # type: ignore[index]
    assert "Flüssigkeit" in Messages("de").advice(FOUND["effects"][0])[1]  # type: ignore[index]


@pytest.mark.parametrize("std", [math.inf, math.nan, 1e308])
def test_a_value_stands_alone_where_what_stands_behind_it_is_not_known(std: float) -> None:
    assert Messages("en").beside_std(0.1234567, std) == "0.12346"
    assert Messages("de").beside_std(0.1234567, std) == "0,12346"
    assert Messages("en").told_std(std) == "–"
