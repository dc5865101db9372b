"""Notes and reasons, and the report of a machine, in German: what the sources say in English is all known."""

import ast
import inspect
import re
from types import FunctionType, ModuleType

import pytest

from impactcell.discrepancy.laws import finding as shot_laws
from impactcell.discrepancy.machine import CATALOGUE, FREE_FORMS, investigation
from impactcell.discrepancy.machine.laws import law_refusal
from impactcell.discrepancy.machine.records import record_notes
from impactcell.discrepancy.machine.search import selection
from impactcell.discrepancy.report import (
    german_machine_sentences,
    german_sentences,
    machine_sentences,
)
from impactcell.discrepancy.report.simulation_notes import DRIFTS
from impactcell.german.findings import with_decimal_commas
from impactcell.quality import DataFault, Fault, channel_faults, motion_faults, notes_of
from impactcell.quality import campaigns as campaign_faults

FILLED = {
    "name": "force", "key": "noise_std_rad_per_s", "unit": "rad", "which": "force",
    "other": "position", "word": "upper",
}  # fmt: skip
"""What the sources put into their sentences where it is a word; elsewhere a number stands."""


def sentences_of(code: ModuleType | FunctionType, least: int) -> list[str]:
    """Texts in a source, as they are said: numbers and words where they are filled in."""
    tree = ast.parse(inspect.getsource(code))
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            found.append("".join(map(_filled, node.values)))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
            found.append(node.value)
    return [text for text in found if len(text.split()) >= least]


def _filled(part: ast.expr) -> str:
    if isinstance(part, ast.Constant):
        return str(part.value)
    assert isinstance(part, ast.FormattedValue)
    return FILLED.get(ast.unparse(part.value), "4.2" if part.format_spec else "7")


@pytest.mark.parametrize("module", [channel_faults, motion_faults, campaign_faults])
def test_every_fault_of_data_is_said_in_german(module: ModuleType) -> None:
    messages = [text for text in sentences_of(module, 6) if ": " in text or "the part" in text]
    messages = [text for text in messages if not text[0].isupper() and not text.startswith("shot ")]
    assert len(messages) >= 2
    for message in messages:
        for count, shot in ((1, 3), (2, None)):
            (note,) = notes_of([DataFault(Fault.OUTLIERS, "force", message, shot)] * count)
            language, said = german_sentences.note(note)
            assert language == "de", note
            assert said.startswith("Daten, Ausreißer: ")
            assert with_decimal_commas(said) == said
            assert re.findall(r"\d[\d.]*", said.replace(",", ".")) or "Feder" in said


def test_every_kind_of_fault_has_a_german_name() -> None:
    message = "the part does not move: its position stays within 1e-06 m, noise is 2e-06 m"
    for fault in Fault:
        _, said = german_sentences.note(*notes_of([DataFault(fault, "force", message)]))
        assert str(fault) == "drift" or str(fault) not in said
        assert said.startswith("Daten, ")


REASONS = (
    selection.SMOOTH_FORCE,
    selection.FREE_FORM,
    selection.FREE_FORM_ELSEWHERE,
    selection.NOT_IN_EVERY_BLOCK,
)


@pytest.mark.parametrize(
    ("code", "least"),
    [
        (shot_laws._refusal, 3),
        (law_refusal.refusal_of, 3),
        (selection._refusal, 2),
        (selection.select_terms, 8),
        (machine_sentences.why_not_named, 3),
    ],
)
def test_every_reason_for_naming_nothing_is_said_in_german(code: FunctionType, least: int) -> None:
    reasons = [text for text in sentences_of(code, least) if not text[0].isupper()]
    assert reasons
    for reason in [*reasons, *REASONS]:
        assert german_sentences.reason(reason)[0] == "de", reason


def test_a_reason_of_one_covariate_and_of_two() -> None:
    english = (
        "the best term, mu (1 + s(|x'|)), leaves 2.31 of 7.4 noise floors: what is missing is no "
        "function of speed alone; of two covariates: the smoothest spline predicts best, so that the "
        "data tell nothing of how the term bends; shots over a wider range of speed and oil would; the "
        "columns oil and age had fewer than 8 different values, too little variety for a function"
    )
    german = (
        "der beste Term, mu (1 + s(|x'|)), lässt 2,31 von 7,4 Rauschschwellen übrig: was fehlt, ist "
        "keine Funktion allein von Geschwindigkeit; über zwei Größen: der glatteste Spline sagt am "
        "besten voraus, so dass die Daten nichts von einer Krümmung sagen; Stöße über einen größeren "
        "Bereich von Geschwindigkeit und oil täten es; zu wenig verschiedene Werte für eine Funktion "
        "(unter 8) hatte: oil und age"
    )
    assert german_sentences.reason(english) == ("de", german)


def test_notes_on_a_machine_are_said_in_german() -> None:
    texts = sentences_of(investigation.hold_what_cannot_be_seen, 6)
    texts += sentences_of(record_notes.notes_of_records, 6)
    notes = [text for text in texts if text[0].isupper() or text[0].isdigit()]
    notes = [note for note in notes if not note.startswith("Hold numbers")]
    assert len(notes) == 7
    alike = "periodic force, covariate friction(oil): on these records like inertia, gravity or drive, and so"
    beside = "covariate_friction(oil) shows only beside quadratic_drag, which hides it on these records;"
    off = "Simulated open loop, held-out records are 0.2 N m off with it, 0.1 without."
    notes.append("restoring force: on these records like a constant force, and so not looked for.")
    notes += [f"{alike} not looked for.", f"{beside} quadratic_drag is not named.", off, DRIFTS]
    notes.append(f"{beside.replace('(oil)', '(oil temp)')} quadratic_drag is not named.")
    notes.append(
        "Nothing would remain if mass were off what is told, shot by shot, but so it goes with oil temp "
        "(correlation +0.87), which no error of a record does."
    )
    for note in notes:
        assert german_sentences.note(note)[0] == "de", note


@pytest.mark.parametrize(
    ("english", "german"),
    [
        ("shot 3 again, its motion 0.2, 1 and 2 times as fast, as often each",
         "Messung 3 noch einmal, die Bewegung 0,2, 1 und 2-mal so schnell, je gleich oft"),
        ("shot 1 again, its drive 2 times as strong", "Messung 1 noch einmal, der Antrieb 2-mal so stark"),
        ("shot 1 again, released from 0.2 times as far",
         "Messung 1 noch einmal, aus 0,2-mal so weit losgelassen"),
        ("shot 2 again, oil_c at -0.5", "Messung 2 noch einmal, oil_c auf -0,5"),
        ("shot 2 again", "Messung 2 noch einmal"),
    ],
)  # fmt: skip
def test_what_to_record_next_is_said_in_german(english: str, german: str) -> None:
    assert german_machine_sentences.setting(english) == german


def test_every_term_and_free_form_has_a_german_name() -> None:
    for name in (*CATALOGUE, *FREE_FORMS):
        assert german_machine_sentences.phrase(name) != machine_sentences.phrase(name)


def test_both_languages_of_a_machine_say_the_same_things() -> None:
    assert set(machine_sentences.__all__) == set(german_machine_sentences.__all__)
