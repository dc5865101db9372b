"""What the report of a machine says in German; each function says what that of `machine_sentences` does."""

from typing import Final

from impactcell.discrepancy.machine import MachineFinding
from impactcell.discrepancy.report.german_held_numbers import held_number
from impactcell.discrepancy.report.german_notes import note
from impactcell.discrepancy.report.german_patterns import Patterns
from impactcell.discrepancy.report.german_reasons import reason
from impactcell.discrepancy.report.german_sentences import equation, in_german, label, written
from impactcell.discrepancy.report.german_words import phrase as channel_name
from impactcell.discrepancy.report.german_words import term_name as phrase
from impactcell.discrepancy.report.machine_sentences import (
    NOT_CONFIRMED,
    law_equation,
    noise_keys,
    why_not_named,
)
from impactcell.german.findings import enumerated, enumerated_names
from impactcell.german.open_loop import german_better_sentence, german_open_loop_sentence
from impactcell.physics.effect_names import as_title

__all__ = ["equation", "headline", "label", "note", "phrase", "reason", "reference", "setting", "written"]
_SETTINGS: Final[Patterns] = (
    (r"^nothing from a fifth to twice of what was done .*",
     ("nichts vom Fünftel bis zum Doppelten des Bisherigen unterscheidet sie: eines von beiden für sich "
      "messen")),
    (r"^shot (\d+) again", r"Messung \1 noch einmal"),
    (r"(?<=\d) and (?=-?[\d.]+)", " und "),
    (r", its motion (.+) times as fast", r", die Bewegung \1-mal so schnell"),
    (r", its motion (.+) times as wide", r", die Bewegung \1-mal so weit"),
    (r", its drive (.+) times as fast", r", der Antrieb \1-mal so schnell"),
    (r", its drive (.+) times as strong", r", der Antrieb \1-mal so stark"),
    (r", released from (.+) times as far", r", aus \1-mal so weit losgelassen"),
    (r", (.+) at (?=-?[\d.])", r", \1 auf "),
    (r", as often each$", ", je gleich oft"),
)  # fmt: skip
"""What to record next."""
_REFERENCES: Final = {
    "Coulomb 1785, normal force by u": "Coulomb 1785, Normalkraft nach u",
    "Stribeck 1902; Bo and Pavelescu 1982": "Stribeck 1902; Bo und Pavelescu 1982",
    "cogging of a motor or gear": "Rasten eines Motors oder Getriebes",
    "force by pressure or current": "Kraft durch Druck oder Strom",
    "found in the records": "in den Messungen gefunden",
    "linear in the place": "linear im Ort",
    "periodic in the place": "periodisch im Ort",
}
"""Where a law comes from; what is not here is a name and a year."""


def headline(finding: MachineFinding) -> str:
    """Say what is established and what remains."""
    before, after = finding.fall.before, finding.fall.after
    if finding.verdict == "untested" and finding.clear_strengths and not finding.noise_is_motion:
        names = enumerated_names([phrase(one.name) for one in finding.clear_strengths], "oder")
        said = (
            f"Nichts ist benannt: Die Abweichung von {before:.2f} Rauschschwellen ist an ihrer Grenze, und "
            f"doch ist die Stärke von 0 verschieden ({names}). Länger, mit weniger Rauschen oder eine "
            "größere oder schnellere Bewegung aufzeichnen."
        )
    elif finding.verdict == "untested" and finding.noise_hides and not finding.missing_blocks:
        said = (
            "Keine Aussage: Das Rauschen der Position verdeckt in der Bewegungsgleichung (Abweichung "
            f"{before:.2f} Rauschschwellen), was der Simulation zufolge fehlt. Mit weniger Rauschen "
            "aufzeichnen, oder eine größere oder schnellere Bewegung."
        )
    elif finding.verdict == "untested" and not finding.missing_blocks:
        said = (
            f"Keine Aussage: das Grundmodell lässt {before:.2f} dessen übrig, was für Rauschen gehalten "
            "wurde; das meiste davon ist also Bewegung von Wert zu Wert. "
            f"{enumerated(noise_keys(finding), 'und')} der Sensoren angeben oder schneller abtasten."
        )
    elif finding.verdict == "untested":
        said = (
            f"Zu wenige Blöcke für eine Aussage: {len(finding.training)} angepasst, {len(finding.held_out)} "
            f"zurückgehalten, etwa {finding.missing_blocks} weitere sind nötig. An zurückgehaltenen ist die "
            f"Abweichung des Grundmodells {before:.2f} Rauschschwellen."
        )
    elif finding.verdict == "no_gap":
        said = (
            "Das Grundmodell erklärt diese Messungen: an zurückgehaltenen ist die Abweichung "
            f"{before:.2f} Rauschschwellen."
        )
    elif finding.verdict == "unknown":
        said = f"Kein bekannter Term erklärt eine Abweichung von {before:.2f} Rauschschwellen"
        if finding.unconfirmed:
            names = enumerated_names([*map(phrase, finding.unconfirmed)], "und")
            lacks = reason(finding.unconfirmed_since.get(finding.unconfirmed[0], NOT_CONFIRMED))[1]
            said = f"{names} würde angepasste Messungen erklären, doch: {lacks}"
        why = reason(finding.steps[0].reason)[1] if finding.steps else ""
        said = f"{said}: {why}." if why else f"{said}."
    else:
        groups = [
            enumerated_names([*map(phrase, (name, *finding.tied_with.get(name, ())))], "oder")
            for name in finding.established
        ]
        tied = " (diese Messungen unterscheiden es nicht)" if any(finding.tied_with.values()) else ""
        said = (
            f"Es fehlt: {enumerated_names(groups, 'und')}{tied}; an zurückgehaltenen Messungen fällt die "
            f"Abweichung von {before:.2f} auf {after:.2f} Rauschschwellen."
        )
        if not finding.is_at_floor:
            said += " Etwas bleibt, das es nicht erklärt."
    law = finding.law
    if law is not None:
        if law.beside:
            beside = as_title(enumerated([held_number(phrase) for phrase in law.beside], "und"))
            bring = "bringt" if len(law.beside) == 1 else "bringen"
            said += f" {beside} {bring} sie auf {law.fall.before:.2f}; daneben:"
        says = equation(law_equation(finding, law))
        if law.listed:
            besides = "daneben " if finding.established else ""
            why = reason(why_not_named(finding, law.listed))[1]
            said += (
                f" {says}, {phrase(law.listed)}, brächte die Abweichung {besides}auf "
                f"{law.fall.after:.2f}; benannt ist es nicht, denn: {why}."
            )
        else:
            kind = (
                "eine glatte Kraft, bekannt als Tabelle"
                if law.slices
                else "ein Gesetz, das keine Liste hatte"
            )
            said += f" {says}, bringt die Abweichung auf {law.fall.after:.2f}: {kind}."
    errors, better = finding.simulated, finding.better_simulated
    if better is not None:
        rmse, names = (errors[-1].rmse, better.rmse), enumerated_names([*map(phrase, better.names)], "oder")
        said += f" {german_better_sentence(names, rmse, finding.base.unit)}"
    fit = errors[-1].fit_percent
    follows = german_open_loop_sentence(channel_name(finding.base.response), fit)
    return f"{written(said)} {follows}".rstrip()


def reference(english: str) -> str:
    """Say where a law comes from."""
    return _REFERENCES.get(english, english)


def setting(english: str) -> str:
    """Say which records to make next."""
    return in_german(english, _SETTINGS)
