"""The German report says what the English one says, and says it in German."""

import ast
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from impactcell.campaign import Coordinate, Excitation
from impactcell.discrepancy.data import CHANNELS
from impactcell.discrepancy.data.prepared_campaign import STRATEGIES
from impactcell.discrepancy.data.prepared_shots import OWN_COVARIATES
from impactcell.discrepancy.laws.law import COVARIATE_WORDS, Law
from impactcell.discrepancy.machine import CATALOGUE, ECCENTRICITY
from impactcell.discrepancy.report import german_machine_sentences, german_sentences, sentences
from impactcell.discrepancy.report.machine_parameters import (
    SYMBOLS,
    machine_parameter_words,
    parameter_name,
    parameter_rows,
)
from impactcell.discrepancy.report.page import SENTENCES, write_reports
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.german.findings import GERMAN_PHASES, REPORTS, german_equation, with_decimal_commas
from impactcell.german.parameters import GERMAN, parameter_words
from impactcell.physics.effects import LIBRARY
from impactcell.physics.free_forms import FREE_FORMS
from tests.discrepancy.test_report import Page
from tests.discrepancy.test_workflow import investigated

REPORT = Path(sentences.__file__).parent
SAME = {"Position", "Parameter", "model.extended.yaml", "Log", "RMS"}
"""Words that both languages write alike."""


class Told(HTMLParser):
    """Pieces of text that a reader sees, but for what is marked as English, code, references and formulas."""

    def __init__(self) -> None:
        super().__init__()
        self.hidden: list[str] = []
        self.pieces: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        marked = tag in {"style", "code", "title", "a", "metadata"} or ("lang", "en") in attrs
        if (marked and tag != "html") or self.hidden:
            self.hidden.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if self.hidden and self.hidden[-1] == tag:
            self.hidden.pop()

    def handle_data(self, data: str) -> None:
        if not self.hidden and (piece := " ".join(data.split())):
            self.pieces.append(piece)


@pytest.fixture(scope="module", params=["mass_error", "actuator_vibration"])
def found(request: pytest.FixtureRequest) -> DiscrepancyResult:
    return investigated(request.param, shots=18)


@pytest.fixture(scope="module")
def pages(found: DiscrepancyResult, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Its reports by language, written once: the pictures are most of the time."""
    directory = tmp_path_factory.mktemp("reports")
    write_reports(found, "eine Kampagne", directory)
    return {language: (directory / name).read_text(encoding="utf-8") for language, name in REPORTS.items()}


@pytest.mark.slow
def test_both_are_whole_and_show_the_same_numbers(pages: dict[str, str]) -> None:
    both = {}
    for language, text in pages.items():
        both[language] = page = Page()
        page.feed(text)
        assert page.open == []
        assert f'<html lang="{language}">' in text
        assert "100 to 100 %" not in text
        assert "100 bis 100 %" not in text
        assert not re.search(r"e-0\d m\b", text)
        assert " µm (" in text
    english, german = both["en"], both["de"]
    assert len(english.headings) == len(german.headings)
    assert english.pictures == german.pictures
    assert english.outside() == german.outside()
    in_tables = [re.findall(r'<td class="n[^"]*">([^<]*)', text) for text in pages.values()]
    assert [with_decimal_commas(re.sub(" to ", " bis ", cell)) for cell in in_tables[0]] == in_tables[1]


@pytest.mark.slow
def test_nothing_is_left_in_english(pages: dict[str, str]) -> None:
    told = {}
    for language, text in pages.items():
        reader = Told()
        reader.feed(text)
        told[language] = reader.pieces
    references = " ".join(effect.reference + effect.equation for effect in LIBRARY.values())
    alike = {
        piece
        for piece in set(told["en"]) & set(told["de"])
        if re.search(r"[A-Za-z]{4}", piece)
        and piece not in {*SAME, *(words for words in GERMAN.values() if GERMAN.get(words.lower()) == words)}
        and piece not in references
    }
    assert alike == set()
    german = " ".join(told["de"])
    for word in (" the ", " and ", " shots", " with ", " held", " noise", " gap"):
        assert word not in german, word
    formulas = "|".join(re.escape(effect.equation) for effect in LIBRARY.values())
    assert re.findall(r"\d\.\d+", re.sub(formulas, "", german)) == []


@pytest.mark.slow
def test_pages_of_driven_records_speak_of_blocks(found: DiscrepancyResult, tmp_path: Path) -> None:
    blocks = replace(found, prepared=replace(found.prepared, excitation=STRATEGIES[Excitation.DRIVEN]))
    write_reports(blocks, "a campaign", tmp_path)
    english, german = ((tmp_path / name).read_text(encoding="utf-8") for name in REPORTS.values())
    held = len(found.held_out)
    assert f"{len(found.prepared.shots)} blocks, driven</h1>" in english
    assert f"{held} blocks never used before" in english
    assert f"{len(found.prepared.shots)} Blöcke, Anregung: angetrieben" in german
    assert f"{held} nie zuvor benutzte Blöcke" in german
    assert "Every block has a friction factor of its own" in english
    assert "Jeder Block hat einen eigenen Reibungsfaktor" in german
    for page, word in ((english, r"\bshots?\b"), (german, r"\bSt[oö](ß|ße|ßen)\b")):
        headings_and_figures = re.findall(r"<(h1|h2|span)[^>]*>(.*?)</\1>", page)
        assert [text for _, text in headings_and_figures if re.search(word, text)] == []


def test_every_parameter_of_the_library_has_german_words_and_its_unit() -> None:
    units = {
        "1": "",
        **{parameter.unit: parameter.unit for e in LIBRARY.values() for parameter in e.parameters},
    }
    for effect in LIBRARY.values():
        for parameter in effect.parameters:
            english, unit = parameter_words(effect.identifier, parameter.name, "en")
            german, german_unit = parameter_words(effect.identifier, parameter.name, "de")
            assert unit == german_unit == ("" if parameter.unit == "1" else units[parameter.unit])
            assert "_" not in english
            assert german in GERMAN.values(), english


@pytest.mark.parametrize("coordinate", Coordinate)
def test_every_parameter_of_a_machine_has_words_in_both_languages_and_its_unit(
    coordinate: Coordinate,
) -> None:
    symbols = SYMBOLS[coordinate]
    units = {
        parameter_name(name, unit, coordinate): ""
        if unit == "1"
        else unit.format(F=symbols["force"], q=symbols["q"])
        for term in CATALOGUE.values()
        for name, unit in term.strengths
    }
    speed = f"stribeck_velocity_{symbols['q']}_per_s"
    units |= {speed: f"{symbols['q']}/s", f"period_{symbols['q']}": symbols["q"], "delay_s": "s"}
    units |= {
        "inertia": "kg m²" if coordinate is Coordinate.ROTATION else "kg",
        "gravity_torque": symbols["force"],
    }
    units |= {f"{ECCENTRICITY}_sine": symbols["q"], "position_offset": symbols["q"], "force_gain": ""}
    units |= {f"amplitude_2_{symbols['F']}": symbols["force"], "centre": "", "scale_2": ""}
    for name, unit in units.items():
        english, german = (machine_parameter_words(name, coordinate, language) for language in ("en", "de"))
        assert english[1] == german[1] == unit, name
        assert "_" not in english[0]
        assert re.sub(r" \d$", "", german[0]) in GERMAN.values(), english


def test_a_parameter_of_the_base_model_is_told_with_its_term() -> None:
    stated = {"coulomb_friction.friction_n": {"value": 2.0}, "inertia": {"value": 1.0}}
    rows = parameter_rows((("", stated),), Coordinate.TRANSLATION, "de")
    assert [(row["term"], row["words"], row["unit"]) for row in rows] == [
        ("coulomb_friction", "Reibung", "N"),
        ("", "Trägheit", "kg"),
    ]


def test_laws_of_a_machine_and_where_they_come_from_are_said_in_german() -> None:
    told = " ".join(
        f"{german_machine_sentences.equation(term.equation)} "
        f"{german_machine_sentences.reference(term.reference)}"
        for term in CATALOGUE.values()
    )
    for word in ("the", "of", "a column", "part that", "and", "by", "in the", "or", "motor or"):
        assert not re.search(rf"\b{word}\b", told), word
    assert "u = Spalte von shots.csv" in told
    assert german_machine_sentences.phrase("law_of_force_over_speed(u^2)") == (
        "Gesetz: Kraft über der Geschwindigkeit (u^2)"
    )


@pytest.mark.parametrize("covariate", COVARIATE_WORDS)
def test_the_equation_of_a_law_of_taps_is_all_german_and_its_numbers_are_short(covariate: str) -> None:
    place = next(form for form in FREE_FORMS.values() if form.covariate == covariate)
    law = Law("law_of_it", place, "u", "amplitude * (u / 0.024200000000000003)", (), ((0.0, 0.0242),))
    assert law.equation.endswith(f"= amplitude * (u / 0.0242), u the {COVARIATE_WORDS[covariate]}")
    told = german_equation(law.equation)
    assert "(u / 0,0242), u = " in told
    for word in ("of", "on", "the", "since", "first", "contact", "force", "with", "gap", "is", "pull"):
        assert not re.search(rf"\b{word}\b", told), told


@pytest.mark.parametrize(
    ("english", "german"),
    [
        (
            "The noise of force is not stated; 0.312 was estimated from neighbouring samples, which is a ...",
            ("de", ("Das Rauschen (Kraft) ist nicht angegeben; 0,312 ist aus benachbarten Messwerten "
                    "geschätzt, eine untere Schranke, wo es korreliert ist.")),
        ),
        (
            "The noise of position is not stated; 1.5 µm was estimated from neighbouring samples, which ...",
            ("de", ("Das Rauschen (Position) ist nicht angegeben; 1,5 µm ist aus benachbarten Messwerten "
                    "geschätzt, eine untere Schranke, wo es korreliert ist.")),
        ),
        (
            ("The noise of position is not stated; 1.55 µm was estimated from samples at rest before "
             "contact, 2.4 times what neighbouring samples show: ... state noise_std_m of sensors: ..."),
            ("de", ("Das Rauschen (Position) ist nicht angegeben; 1,55 µm ist aus Messwerten in Ruhe vor "
                    "dem Kontakt geschätzt, das 2,4-Fache dessen, was benachbarte zeigen: es ist korreliert "
                    "oder hat Ausreißer. Was sich in Ruhe bewegt, zählt als Rauschen: noise_std_m unter "
                    "sensors: position in campaign.yaml angeben, wenn es bekannt ist.")),
        ),
        (
            ("The noise of force is not stated; 0.62 N was estimated from samples at rest after the tap, 1.5 "
             "times what neighbouring samples show: ... state noise_std_n of sensors: force in ..."),
            ("de", ("Das Rauschen (Kraft) ist nicht angegeben; 0,62 N ist aus Messwerten in Ruhe nach dem "
                    "Stoß geschätzt, das 1,5-Fache dessen, was benachbarte zeigen: es ist korreliert oder "
                    "hat Ausreißer. Was sich in Ruhe bewegt, zählt als Rauschen: noise_std_n unter sensors: "
                    "force in campaign.yaml angeben, wenn es bekannt ist.")),
        ),
        (
            ("The noise of position is stated as 1.5 µm, and neighbouring samples scatter by 3.1 µm: gaps "
             "are told in what is stated, and so are too large; check noise_std_m of sensors: position ..."),
            ("de", ("Das Rauschen (Position) ist mit 1,5 µm angegeben, und benachbarte Messwerte streuen um "
                    "3,1 µm: Abweichungen zählen in dem, was angegeben ist, und sind damit zu groß; "
                    "noise_std_m unter sensors: position in campaign.yaml prüfen.")),
        ),
        ("Shot 7 has a gap in time; what happened in it is lost.",
         ("de", "Stoß 7 hat eine Lücke in der Zeit; was darin geschah, ist verloren.")),
        ("Data, clipped: shot 2: the force stands at its upper end, 5.2, for 12 samples.",
         ("en", "Data, clipped: shot 2: the force stands at its upper end, 5.2, for 12 samples.")),
    ],
)  # fmt: skip
def test_notes_are_said_in_german_where_it_has_words_for_them(english: str, german: tuple[str, str]) -> None:
    assert german_sentences.note(english) == german


def test_notes_on_what_a_campaign_lacks_are_known() -> None:
    lacking = STRATEGIES[Excitation.TAP].missing_information([])
    assert len(lacking) > 5
    assert {german_sentences.note(note)[0] for note in lacking} == {"de"}


def test_templates_show_the_same_things() -> None:
    """What is computed for one page is on the other, too, whatever its sentences are."""

    def shown(name: str) -> Counter[str]:
        text = (REPORT / "templates" / f"{name}.j2").read_text(encoding="utf-8")
        pieces = re.findall(r"\{\{.*?\}\}|\{%.*?%\}", text)
        names = [re.sub(r'"[^"]*"', "", piece) for piece in pieces]
        ignored = ("words", "setting", "shape_in_words", "replace", "map", "lower", "join", "format")
        return Counter(
            word
            for piece in names
            for word in re.findall(r"[a-z_]+(?:\.[a-z_]+)*", piece)
            if word not in ignored
        )

    assert shown("report.html") == shown("report.de.html")


def test_every_function_of_one_language_is_in_the_other() -> None:
    def public(module: object) -> set[str]:
        return {name for name in ("headline", "noise_floor_sentence", "advice", "next_step", "split_sentence",
                                  "law_sentences", "phrase", "label", "setting", "shape", "written", "note")
                if callable(getattr(module, name, None))}  # fmt: skip

    assert public(sentences) == public(german_sentences)
    assert list(SENTENCES) == list(REPORTS)


def test_every_label_of_a_figure_is_known() -> None:
    labels = {"before", "after", "training", "nominal"}  # those that reach `label` in a variable
    for file in ("figures.py", "law_figures.py", "page.py"):
        for node in ast.walk(ast.parse((REPORT / file).read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "label":
                labels |= {
                    part.value
                    for argument in node.args
                    for part in ast.walk(argument)
                    if isinstance(part, ast.Constant) and isinstance(part.value, str)
                }
    labels |= {"all shots", "order", "residual, times {} [noise std]", "mean residual [noise std]"}
    for label in labels:
        assert german_sentences.label(label) != label or label in SAME
    with pytest.raises(KeyError):
        german_sentences.label("a label that nobody has put into German")


def test_phases_channels_covariates_and_effects_have_german_names() -> None:
    names = [*GERMAN_PHASES, *CHANNELS, *OWN_COVARIATES, *Excitation, *LIBRARY]
    verdicts = ["named", "tied", "no_gap", "unknown", "untested"]
    for name in [*names, *verdicts]:
        assert german_sentences.phrase(name) != sentences.phrase(name), name
    assert german_sentences.phrase("oil_temperature") == "oil temperature"


@pytest.mark.parametrize(
    ("english", "german"),
    [
        ("6000 mm/min, 18.9 kg, direction -1, after 30 s at rest",
         "6000 mm/min, 18,9 kg, Richtung -1, nach 30 s Ruhe"),
        ("batch 2 again, after the others", "Charge 2 noch einmal, nach den anderen"),
        ("record the actuator's position", "die Position des Antriebs aufzeichnen"),
    ],
)  # fmt: skip
def test_settings_are_said_in_german(english: str, german: str) -> None:
    assert german_sentences.setting(english) == german


@pytest.mark.parametrize(
    ("english", "german"),
    [
        ("S-shaped in force, times direction, largest in the middle in the phase",
         "S-förmig in Kraft, mal Richtung, am größten in der Mitte der Phase"),
        ("oscillating (5 changes of sign) in position, largest late in the phase",
         "schwingend (5 Vorzeichenwechsel) in Position, am größten spät in der Phase"),
        ("no smooth shape along the phase", "kein glatter Verlauf über die Phase"),
    ],
)  # fmt: skip
def test_shapes_are_said_in_german(english: str, german: str) -> None:
    assert german_sentences.shape(english) == german


def test_what_is_said_of_a_laws_source_is_german_and_works_keep_their_titles() -> None:
    assert german_sentences.reference(LIBRARY["viscous_friction"].reference) == (
        "Gleichung (2) der zugrunde liegenden Arbeit; Olsson et al., Friction models and friction "
        "compensation, Eur. J. Control 4 (1998)"
    )
    author = r"[A-Z][\w-]+( und [A-Z][\w-]+)?, .*\(\d{4}\)"
    for effect in LIBRARY.values():
        said = german_sentences.reference(effect.reference)
        assert said != effect.reference or re.match(author, said), effect.identifier
