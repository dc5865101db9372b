"""What the discrepancy workflow found, said in German from its `result.json`, whose headline is English."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from impactcell.german.open_loop import german_better_sentence, german_open_loop_sentence
from impactcell.numerics.compilation import COMPILING
from impactcell.physics.effect import German
from impactcell.physics.effect_names import in_words
from impactcell.physics.effects import LIBRARY

REPORTS: Final[Mapping[str, str]] = {"en": "report.html", "de": "report.de.html"}
"""Files of the report by the language that it is in; the first is always there."""
GERMAN_PHASES: Final = {
    "preload": "Vorspannen",
    "loading": "Belasten",
    "unloading": "Entlasten",
    "free_slide": "freies Gleiten",
    "stop": "Stillstand",
    "between_shots": "zwischen den Stößen",
    "driven": "angetriebene Bewegung",
}
"""By the name of a phase in `result.json`."""
GERMAN_QUANTITIES: Final = {
    "time": "Zeit", "force": "Kraft", "position": "Position", "actuator": "Antrieb", "shot": "Stoß",
    "velocity": "Geschwindigkeit", "mass": "Masse", "direction": "Richtung", "batch": "Charge",
    "covariate": "Einflussgröße", "ignored": "nichts",
}  # fmt: skip
"""What a column of a dropped file can mean."""
GERMAN_STATES: Final = {
    "speed": "Geschwindigkeit",
    "load": "Last",
    "indentation": "Eindrückung",
    "indentation_rate": "Eindrückgeschwindigkeit",
    "gap": "Abstand",
}
"""What a law may be a function of, beside the quantities."""
GERMAN_COVARIATES: Final = {
    "speed of sliding": "Gleitgeschwindigkeit",
    "position on the table": "Position auf dem Tisch",
    "rate of indentation": "Eindrückgeschwindigkeit",
    "time since first contact": "Zeit seit dem ersten Kontakt",
    "contact force": "Kontaktkraft",
    "column": "Spalte",
}
"""What a law of taps calls the same in its equation."""
GERMAN_STEPS: Final = {
    "unpacking": "Auspacken",
    "import": "Dateien lesen",
    "estimate": "Reibung schätzen",
    "discrepancy": "Abweichung suchen",
    "model accept": "Vorhersagen, was das Annehmen ändert",
    COMPILING: "Übersetzen für diesen Rechner, einmal: ein bis zwei Minuten, auf einem langsamen länger",
    "fitting the nominal model": "Modell anpassen",
    "locating the gap and naming effects": "Abweichung orten und Effekte nennen",
    "holding names against free forms": "Namen gegen freie Formen halten",
    "proving on held-out shots": "An zurückgehaltenen Stößen prüfen",
    "looking for a law that nobody has listed": "Nach einem Gesetz suchen, das keine Liste hat",
    "planning the next experiment": "Nächsten Versuch planen",
    "writing the report": "Bericht schreiben",
    "calibrating": "Kalibrieren",
    "naming what the base model lacks": "Nennen, was dem Grundmodell fehlt",
}
"""By the name of a step; one that is not here is shown as it is called."""
ENGLISH_STEPS: Final = {
    "import": "reading the files",
    "estimate": "estimating friction",
    "discrepancy": "looking for what the model misses",
    "model accept": "predicting what accepting would change",
}
"""Steps whose own name is that of a command."""


GERMAN_TERMS: Final = {
    "coulomb_friction": "Coulombsche Reibung",
    "directional_viscous_friction": "Richtungsabhängige viskose Reibung",
    "load_dependent_friction": "Lastabhängige Reibung",
    "covariate_friction": "Reibung je Einflussgröße",
    "covariate_force": "Kraft je Einflussgröße",
    "periodic_force": "Periodische Kraft",
    "hardening_spring": "Verhärtende Feder",
    "gravity_torque": "Schweremoment",
    "presliding_hysteresis": "Hysterese vor dem Gleiten",
    "friction_over_speed": "Reibung über der Geschwindigkeit",
    "friction_over_load": "Reibung über der Last",
    "friction_over_position": "Reibung über dem Ort",
    "force_over_position": "Kraft über dem Ort",
    "force_over_speed": "Kraft über der Geschwindigkeit",
}
"""Terms and free forms of a machine that the library of effects does not have."""


def german_effect(identifier: str) -> str:
    """Name an effect; one of a base model, or of somebody's own, as it is called.

    >>> german_effect("viscous_friction"), german_effect("own_effect")
    ('Viskose Reibung', 'own effect')
    """
    german = german_texts(identifier)
    words = re.sub(r"^friction over column ", "Reibung über der Spalte ", in_words(identifier))
    return GERMAN_TERMS.get(identifier, words) if german is None else german.name


def german_texts(identifier: str) -> German | None:
    """Give what an effect says of itself in German; None for one that says nothing."""
    effect = LIBRARY.get(identifier)
    return None if effect is None else effect.german


def enumerated(names: Sequence[str], conjunction: str) -> str:
    """Names in a row, as both languages write them: a, b and c."""
    *first, last = names
    return f"{', '.join(first)} {conjunction} {last}" if first else last


def enumerated_names(names: Sequence[str], conjunction: str) -> str:
    """Names of effects in a row: adjectives stand small but where a sentence may begin with one.

    >>> enumerated_names(["Viskose Reibung", "Lastabhängige Reibung", "Hysterese vor dem Gleiten"], "oder")
    'Viskose Reibung, lastabhängige Reibung oder Hysterese vor dem Gleiten'
    """
    return enumerated([*names[:1], *map(_within_a_sentence, names[1:])], conjunction)


def _within_a_sentence(name: str) -> str:
    """Write an adjective small: a word with an ending of one, before a noun or before another of them."""
    is_adjective = re.match(r"\w+(?:e|er|es) (?:[A-ZÄÖÜ]|[a-zäöü]{3,}(?:e|er|es) )", name)
    return name[:1].lower() + name[1:] if is_adjective else name


def with_decimal_commas(text: str) -> str:
    """Write the numbers of a text as German does.

    >>> with_decimal_commas("0.35 N. 12.5 bis 15 kg")
    '0,35 N. 12,5 bis 15 kg'
    """
    return re.sub(r"(?<=\d)\.(?=\d)", ",", text)


def german_equation(equation: str) -> str:
    """Say the words in the equation of a law in German.

    >>> german_equation("-s(u) sign(q') with s(u) = 0.5 u^2, u the position")
    "-s(u) sign(q') mit s(u) = 0,5 u^2, u = Position"
    """
    names = {**GERMAN_QUANTITIES, **GERMAN_STATES, **GERMAN_COVARIATES}
    said = re.sub(r" with (?=s\()", " mit ", with_decimal_commas(equation))
    said = said.replace("u a column of shots.csv", "u = Spalte von shots.csv")
    said = said.replace("the part that differs: ", "davon der Unterschied: ")
    said = re.sub(r"\bpull s\(gap(.*?), gap <", r"Anziehung s(Abstand\1, Abstand <", said)
    for english, german in (
        (" and w the ", " und w the "),
        (" on the part", " auf das Teil"),
        (" is shown", " wird angezeigt"),
    ):
        said = said.replace(english, german)
    words = "|".join(GERMAN_COVARIATES)
    return re.sub(rf"\b([uw]) the ({words}|\w+)", lambda m: f"{m[1]} = {names.get(m[2], m[2])}", said)


def german_headline(result: Mapping[str, Any]) -> str:
    """Say the outcome in German; as it was said where its format does not have what it takes."""
    gap = result.get("gap", {}).get("held_out")
    if not gap:
        return str(result.get("headline", ""))
    before, after = (with_decimal_commas(f"{gap[when]:.2f}") for when in ("before", "after"))
    match result["verdict"]:
        case "untested":
            counts = _counts(result)
            said = f"Die Messungen reichen für keine Aussage{counts}; Abweichung des Modells: {before}."
            if hints := result.get("remaining", {}).get("hints"):
                names = enumerated_names([*map(german_effect, hints)], "oder")
                said = (
                    f"Nichts ist benannt: Die Abweichung von {before} liegt am Rauschen der Sensoren, und "
                    f"doch ist die Stärke von 0 verschieden ({names}). Länger, mit weniger Rauschen oder mit "
                    "größerer Bewegung aufzeichnen."
                )
        case "no_gap":
            said = f"Das Modell erklärt die Messungen: Abweichung {before}."
        case "unknown":
            what = f" die Abweichung von {before}"
            if "what the training shots show and held-out ones do not" in result.get("headline", ""):
                what = f", was angepasste Messungen zeigen und zurückgehaltene nicht: Abweichung {before}"
            said = f"Kein bekannter Effekt erklärt{what}{_where(result)}."
            if result.get("unconfirmed"):
                names = enumerated_names([*map(german_effect, result["unconfirmed"])], "und")
                why = "zurückgehaltene bestätigen es nicht"
                since = result.get("unconfirmed_since") or {}
                if any(" want it" in lacks for lacks in since.values()):
                    why = "zurückgehaltene wollen es, doch reicht das nicht (warum, steht im Bericht)"
                if "without repeated settings held-out shots" in result.get("headline", ""):
                    why = "ohne Wiederholungen können zurückgehaltene es nicht bestätigen"
                said = f"{names} würde angepasste Messungen erklären, {why}."
            said += _outdone(result)
        case _:
            said = f"Es fehlt: {_missing(result)}; damit fällt {_fall(result, before, after)}."
            if not result.get("remaining", {}).get("explained", True):
                share = 100.0 * (result["remaining"].get("share") or 0.0)
                left = (
                    f"{share:.0f} % der Abweichung bleiben" if share else "Etwas bleibt, das er nicht erklärt"
                )
                said += f" {left}{_where(result)}."
    law = result.get("law")
    if law:
        what = "Ein Gesetz, das keine Bibliothek hat, passt dazu"
        if "a law beside those that were given" in result.get("headline", ""):
            what = "Ein Gesetz neben den mitgegebenen passt dazu"
        if law.get("term"):
            what = f"{german_effect(law['term'])} passt dazu, ist aber nicht benannt"
        said += f" {what}: {german_equation(law['equation'])}{_fall_by(law)}."
    said += _follows(result.get("simulation"))
    return f"{said} (Abweichungen an zurückgehaltenen Messungen; 1 ist das Rauschen der Sensoren.)"


def _fall_by(law: Mapping[str, Any]) -> str:
    """Say what a law takes of the held-out gap; nothing where its format does not have it."""
    gap = law.get("held_out")
    if not gap or None in (gap["before"], gap["after"]):
        return ""
    return with_decimal_commas(f"; damit fällt die Abweichung von {gap['before']:.2f} auf {gap['after']:.2f}")


def _counts(result: Mapping[str, Any]) -> str:
    """Say how much was fitted and held out, and how much more it takes; only the English headline has it."""
    told = r"Too few \w+ to say: (\d+) to fit and (\d+) held out, about (\d+) more are needed"
    counts = re.match(told, result.get("headline", ""))
    return counts.expand(r": \1 angepasst, \2 zurückgehalten, etwa \3 weitere sind nötig") if counts else ""


def _fall(result: Mapping[str, Any], before: str, after: str) -> str:
    """Say what falls: the gap, or only the spread between shots beside traces that stay as they are."""
    gap = result["gap"]
    parts, closed = gap.get("parts", {}).get("held_out"), gap["held_out"].get("closed_ci95")
    if parts and closed and closed[0] <= 0.0:
        spreads = [parts[when]["friction_factors"] for when in ("before", "after")]
        if None not in spreads and spreads[1] < spreads[0]:
            first, last, stays = (f"{value:.2f}" for value in (*spreads, parts["after"]["traces"]))
            return with_decimal_commas(
                f"die Streuung der Reibung zwischen Messungen vom {first}-Fachen auf das {last}-Fache "
                f"der von Wiederholungen, die Abweichung der Verläufe bleibt bei {stays}"
            )
    return f"die Abweichung von {before} auf {after}"


def _follows(simulation: Mapping[str, Any] | None) -> str:
    """Say where the model, simulated by itself, follows little of what was held out."""
    if not simulation:
        return ""
    channel, fit = simulation["channel"], simulation["fit_percent"]["after"]
    said = german_open_loop_sentence(
        GERMAN_QUANTITIES.get(channel, channel), math.nan if fit is None else fit
    )
    if better := simulation.get("better_with"):
        rmse = simulation["rmse"]["after"], better["rmse"]
        names = enumerated_names([*map(german_effect, better["effects"])], "oder")
        said = f"{german_better_sentence(names, rmse, simulation['unit'])} {said}"
    return f" {said}".rstrip()


def _outdone(result: Mapping[str, Any]) -> str:
    outdone = result.get("outdone")
    if not outdone or not outdone["form"]:
        return ""
    name, form = german_effect(outdone["effect"]), f"eine freie Funktion s, {outdone['form']},"
    says = "folgt an derselben Stelle besser: Das Gesetz ist ein anderes"
    if not outdone["same_place"]:
        says = "erklärt ebenso viel: Das ist nicht die Ursache"
    return f" {name} kommt ihr am nächsten, aber {form} {says}."


def _missing(result: Mapping[str, Any]) -> str:
    groups = [
        enumerated_names([*map(german_effect, (effect["effect"], *effect.get("tied_with", ())))], "oder")
        for effect in result["effects"]
    ]
    is_tied = any(effect.get("tied_with") for effect in result["effects"])
    return enumerated_names(groups, "und") + (" (diese Messungen unterscheiden es nicht)" if is_tied else "")


def _where(result: Mapping[str, Any]) -> str:
    """Say in which phases of a tap something remains; a machine, which is judged in blocks, has none."""
    if "blocks" in result:
        return ""
    places = result.get("remaining", {}).get("where") or []
    if not places and result.get("unexplained"):
        places = [result["unexplained"]]
    names = [GERMAN_PHASES.get(place["phase"], place["phase"].replace("_", " ")) for place in places]
    return f" (Phase: {', '.join(names)})" if names else ""
