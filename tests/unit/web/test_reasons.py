"""Published reasons are said in German where the page speaks German."""

import ast
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import impactcell
from impactcell.measurements import ColumnMeaning, guess, make_campaign, read_tables
from impactcell.prediction.equations import beyond_calibration
from impactcell.tracking.wear_batch import FrictionObservation, TrackerSettings, initial_state, update
from impactcell.tracking.wear_batch.batch_change_detection import reason_not_ready
from impactcell.tracking.wear_batch.input_validation import CycleClock, update_clock, validate_estimate
from impactcell.web.cell_view import CellView
from impactcell.web.interface import CellNews
from impactcell.web.texts.import_notes import page_note
from impactcell.web.texts.reasons import german_reason
from tests.snapshots import make_capture, make_snapshot
from tests.unit.measurements.records import sampled, taps, write_logger_file
from tests.unit.prediction.test_estimate import GOOD, MODEL

PACKAGE = Path(impactcell.__file__).parent
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
        ("the reference is being learned, 1 more cycle",
         "der Vergleich wird noch gelernt, ein weiterer Zyklus"),
        ("the reference is being learned, 12 more cycles",
         "der Vergleich wird noch gelernt, 12 weitere Zyklen"),
        ("from the module's summary: no force was recorded",
         "aus der Zusammenfassung des Moduls: Kraft wurde nicht aufgezeichnet"),
        ("residuals are 2.31 times the sensors' noise: the model lacks something",
         "die Abweichung ist 2,31-mal das Rauschen der Sensoren: dem Modell fehlt etwas"),
        ("friction is found to go unsteadily from cycle to cycle, the past is seen so from here on",
         ("die Reibung ändert sich, wie sich zeigt, von Zyklus zu Zyklus unstetig; so wird die "
          "Vergangenheit von nun an gesehen")),
        ("since cycle 188 mu_s goes by -0.00899 ± 0.0021 in 1000 cycles, 0.0133 before",
         "seit Zyklus 188 ändert sich µs um -0,00899 ± 0,0021 in 1000 Zyklen, davor um 0,0133"),
        ("what nobody has translated; mu_s is missing, the cycle is not used",
         "what nobody has translated; µs fehlt, der Zyklus wird nicht verwendet"),
        ("", ""),
    ],
)  # fmt: skip
def test_a_sentence(english: str, german: str) -> None:
    assert german_reason(english) == german


def test_what_the_tracker_says_of_a_cycle_is_said_in_german() -> None:
    """Every note of an estimate or a cycle number that is not as it should be, made by the tracker itself."""
    values = [math.nan, math.inf, -0.1, 12.0]
    notes = [validate_estimate(value, 0.002)[0] for value in values]
    notes += [validate_estimate(0.2, std)[0] for std in (0.0, -0.002, 1e-12)]
    clock = CycleClock()
    for cycle in (100, 101, 104, 103, 102, 102, 3):
        clock, timing = update_clock(clock, cycle, (1000 + cycle) * 10**9, 64)
        notes += timing.note.split("; ") if timing.note else []
    notes.append(update_clock(clock, 900, 0, 64, farthest=100.0)[1].note)
    assert notes[-1] == "cycle number 900 after 3 is in doubt, not used"
    notes.append(reason_not_ready(initial_state()))
    result = None
    for cycle in range(1, 7):
        state = initial_state() if result is None else result.state
        result = update(TrackerSettings(), state, FrictionObservation(cycle, 0.2, 0.002))
    assert result is not None
    notes += result.notes
    assert notes[-1].startswith("mu_s has been the same 6 times in a row, not used: ")
    assert len(notes) == 15
    for note in notes:
        assert german_reason(note) != note
        assert not words(german_reason(note)) & {
            *ENGLISH,
            "cycle",
            "cycles",
            "came",
            "used",
            "mu_s",
            "clock",
            "stuck",
        }


def test_a_card_has_both_languages() -> None:
    snapshot = make_snapshot(make_capture(3))
    mu_s = replace(snapshot.friction.mu_s, reason="no position was recorded")
    view = CellView("press-1")
    view.take(CellNews("press-1", replace(snapshot, friction=replace(snapshot.friction, mu_s=mu_s))))
    reasons = json.loads(view.encode("card"))["reasons"]
    assert reasons["en"]["mu_s"] == "no position was recorded"
    assert reasons["de"]["mu_s"] == "Position wurde nicht aufgezeichnet"
    assert reasons["en"].keys() == reasons["de"].keys()


def test_a_card_names_the_model_in_both_languages() -> None:
    snapshot = make_snapshot(make_capture(3))
    view = CellView("press-1")
    view.take(CellNews("press-1", replace(snapshot, model_name="prototype + viscous_friction + own")))
    card = json.loads(view.encode("card"))
    assert card["values"]["Model/Name"] == "prototype + viscous_friction + own"
    assert card["model"] == {
        "en": "prototype + viscous friction + own",
        "de": "prototype + Viskose Reibung + own",
    }


def test_what_import_notes_of_taps_is_said_in_german(tmp_path: Path) -> None:
    """Made by import itself, so that a note that is put otherwise is missed here."""
    rng = np.random.default_rng(2)
    write_logger_file(tmp_path / "tap.csv", taps((3000,), (18.9,))[0], rng)
    tables = read_tables(tmp_path / "tap.csv")
    mapping = guess(tables)
    notes = [*make_campaign(tables, mapping).notes, *(item.why for item in mapping.assignments)]
    assert len(notes) >= 7
    said = [page_note(note, "de") for note in notes]
    assert {language for language, _ in said} == {"de"}, said
    assert ("de", "die Zeilen neben den Spalten sagen: Masse 18,9 kg, Geschwindigkeit 3000 mm/min") in said
    assert not any("--" in page_note(note, language)[1] for note in notes for language in ("en", "de"))


def test_that_taps_have_no_position_is_said_in_both_languages(tmp_path: Path) -> None:
    """It came out when friction was asked for: "no tap of the campaign can be used"."""
    write_logger_file(tmp_path / "tap.csv", taps((3000,), (18.9,))[0], np.random.default_rng(2))
    tables = read_tables(tmp_path / "tap.csv")
    whole = guess(tables)
    forces = [item for item in whole.assignments if item.meaning is not ColumnMeaning.POSITION]
    notes = make_campaign(tables, replace(whole, assignments=tuple(forces))).notes
    (told,) = [note for note in notes if "no position" in note]
    assert page_note(told, "en")[1].endswith("and no model by themselves")
    assert page_note(told, "de") == ("de", page_note(told, "de")[1])
    assert "keine Position" in page_note(told, "de")[1]
    assert not [note for note in make_campaign(tables, whole).notes if "no position" in note]


def test_what_import_notes_of_faulty_data_is_said_in_german(tmp_path: Path) -> None:
    """A late channel, and what is given and not used, were English on the German page."""
    rng = np.random.default_rng(2)
    for number, tap in enumerate(taps((2000, 3000, 4000), (18.9,))):
        time, force, position = sampled(tap, rng)
        late = np.interp(time - 1e-3, time, position)
        rows = [f"{t:.5f},{f:.3f},{x:.8f}" for t, f, x in zip(time, force, late, strict=True)]
        head = (
            f"mass: 18.9 kg\nvelocity: {6e4 * tap.velocity_m_s:g} mm/min\n\ntime [s],force [N],position [m]"
        )
        (tmp_path / f"tap{number}.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
    tables = [table for file in sorted(tmp_path.iterdir()) for table in read_tables(file)]
    said = [page_note(note, "de") for note in make_campaign(tables, guess(tables)).notes]
    assert {language for language, _ in said} == {"de"}, said
    assert any("Position ist 1 ms später aufgezeichnet als Kraft" in note for _, note in said), said
    assert not any(note.endswith(".") for _, note in said), "the page ends each"


@pytest.mark.parametrize(
    ("english", "german"),
    [
        ("given", "angegeben"),
        ("counts the rows", "zählt die Zeilen"),
        (
            "given, and not used, for it is of taps: stroke, trigger (--excitation tap says otherwise)",
            "angegeben und nicht verwendet, weil es nur für Stöße gilt: Hub, Kraft bei Berührung",
        ),
    ],
)
def test_what_was_given_is_said_in_german(english: str, german: str) -> None:
    assert page_note(english, "de") == ("de", german)


SAID_BY = (
    "features/channels",
    "features/contact",
    "features/segment",
    "features/slide",
    "prediction/equations",
    "prediction/free_slide_friction",
    "prediction/mass_interpolation",
    "prediction/waveform",
)
"""Modules whose errors become the reason of a coefficient."""
PLACEHOLDERS = {
    "name": "force",
    "model.name!r": "'own'",
    "fault": "the part did not slide",
    "_way_out(model, 'mass and velocity')": "check mass and velocity",
    "_way_out(model, 'mass, stroke and velocity')": "check mass, stroke and velocity",
}


def sample(message: ast.expr) -> list[str]:
    """What a message may say, with something in the place of each placeholder."""
    if isinstance(message, ast.IfExp):
        return [*sample(message.body), *sample(message.orelse)]
    if isinstance(message, ast.Constant):
        return [str(message.value)]
    assert isinstance(message, ast.JoinedStr)
    parts = []
    for part in message.values:
        if isinstance(part, ast.FormattedValue):
            name = ast.unparse(part.value) + ("!r" if part.conversion == ord("r") else "")
            parts.append(PLACEHOLDERS.get(name, "12"))
        else:
            parts.append(str(ast.literal_eval(part)))
    return ["".join(parts)]


def tap_messages() -> list[str]:
    found = []
    for module in SAID_BY:
        tree = ast.parse((PACKAGE / f"{module}.py").read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args:
                found += sample(node.exc.args[0])
    return found


@pytest.mark.parametrize("english", [*tap_messages(), f"no waveform estimate: {tap_messages()[0]}"])
def test_why_a_tap_shows_no_friction_is_said_in_german(english: str) -> None:
    german = german_reason(english)
    for part, said in zip(english.split("; "), german.split("; "), strict=True):
        assert part != said, f"say it in impactcell/web/texts/tap_reasons.py: {part}"
    assert not words(german) & (ENGLISH | {"part", "samples", "record", "slide", "did", "check"}), german
