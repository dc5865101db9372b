"""What the report says in German; each function says the same as the one of its name in `sentences`.

Notes that are not among `_NOTES`, and reasons why no law is proposed, stay as the workflow says them, in
English.
"""

import math
import re
from typing import Any, Final

from impactcell.discrepancy.data import CHANNELS
from impactcell.discrepancy.report import sentences
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.report.sentences import NOT_SET
from impactcell.discrepancy.search import UNTESTED
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.german.findings import (
    GERMAN_PHASES,
    GERMAN_QUANTITIES,
    german_headline,
    german_texts,
    with_decimal_commas,
)
from impactcell.physics.effect import German
from impactcell.physics.effects import find_effect
from impactcell.physics.free_column_forms import printed

_WORDS: Final = {
    **GERMAN_PHASES,
    **GERMAN_QUANTITIES,
    "named": "benannt",
    "tied": "nicht zu unterscheiden",
    "no_gap": "keine Abweichung",
    "unknown": "unbekannt",
    "untested": "nicht geprüft",
    "tap": "Stoß",
    "driven": "angetrieben",
    "dwell": "Ruhezeit",
    "start": "Anfangslage",
    "initial_speed": "Anfangsgeschwindigkeit",
    "order": "Reihenfolge",
    "speed": "Geschwindigkeit",
    "indentation": "Eindrückung",
    "gap": "Abstand",
    "indentation_rate": "Eindrückgeschwindigkeit",
    "stated": "angegeben",
    "estimated": "geschätzt",
}
"""Phases, channels, covariates and verdicts, by their names in the workflow."""
_LABELS: Final = {
    "all shots": "alle Stöße",
    "order": "Reihenfolge",
    "|score| over its spread": "|Score| durch seine Streuung",
    "before": "vorher",
    "after": "nachher",
    "nominal": "Ausgangsmodell",
    "measured": "gemessen",
    "extended model": "erweitertes Modell",
    "nominal model": "Ausgangsmodell",
    "residual\n[noise std]": "Residuum\n[Rauschen]",
    "time [ms]": "Zeit [ms]",
    "shot": "Stoß",
    "training": "angepasst",
    "held out": "zurückgehalten",
    "shot, in order": "Stoß, der Reihe nach",
    "friction factor [%]": "Reibungsfaktor [%]",
    "place within the phase, 0 = start, 1 = end": "Ort in der Phase, 0 = Anfang, 1 = Ende",
    "residual, times {} [noise std]": "Residuum, mal {} [Rauschen]",
    "mean residual [noise std]": "mittleres Residuum [Rauschen]",
    "spline": "Spline",
    "spline, 95 % band": "Spline, 95-%-Band",
    "s(u) less its mean": "s(u) ohne seinen Mittelwert",
    "95 % bands": "95-%-Bänder",
    "below: where samples lie": "unten: wo Messwerte liegen",
    "nominal plant": "Ausgangsmodell",
}
"""Labels of the figures."""
_SETTINGS: Final = (
    (r"^weigh the part: .*",
     "das Teil wiegen: kein Stoß unterscheidet seine Masse vom Maßstab des Kraftsensors"),
    (r"^load the force sensor .*", "den Kraftsensor mit einem bekannten Gewicht belasten"),
    (r"^repeat the campaign .*",
     "die Kampagne mit anderer Folge von Chargen, Richtungen und Ruhezeiten wiederholen"),
    (r"^record the actuator's position$", "die Position des Antriebs aufzeichnen"),
    (r"^no setting within reach .*",
     "keine erreichbare Einstellung unterscheidet sie: eines von beiden für sich messen"),
    (r"\bdirection ([+-]\d)", r"Richtung \1"),
    (r"\bafter ([\d.]+) s at rest$", r"nach \1 s Ruhe"),
    (r"^batch (\d+) again, after the others$", r"Charge \1 noch einmal, nach den anderen"),
)  # fmt: skip
_SHAPES: Final = (
    (r"^the friction factors change .*",
     "die Reibungsfaktoren ändern sich von Stoß zu Stoß mit den genannten Größen"),
    (r"^no smooth shape along the phase$", "kein glatter Verlauf über die Phase"),
    (r"\bone-sided in (\w+)", lambda m: f"einseitig in {phrase(m[1])}"),
    (r"\bS-shaped in (\w+)", lambda m: f"S-förmig in {phrase(m[1])}"),
    (r"\bbowed in (\w+)", lambda m: f"gewölbt in {phrase(m[1])}"),
    (r"\boscillating \((\d+) changes of sign\) in (\w+)",
     lambda m: f"schwingend ({m[1]} Vorzeichenwechsel) in {phrase(m[2])}"),
    (r", times (\w+)", lambda m: f", mal {phrase(m[1])}"),
    (r"largest early in the phase$", "am größten früh in der Phase"),
    (r"largest in the middle in the phase$", "am größten in der Mitte der Phase"),
    (r"largest late in the phase$", "am größten spät in der Phase"),
)  # fmt: skip

_NOTES: Final = (
    (r"The noise of (\w+) is not stated; (\S+) was estimated .*",
     lambda m: f"Das Rauschen ({phrase(m[1])}) ist nicht angegeben; {m[2]} ist aus benachbarten Messwerten "
     "geschätzt, eine untere Schranke, wo es korreliert ist."),
    (r"The mass of shot (\d+) is not stated and is fitted, block by block\.",
     r"Die Masse zu Stoß \1 ist nicht angegeben und wird angepasst, Block für Block."),
    (r"(\d+) of (\d+) training blocks were left out: .*",
     r"\1 von \2 Blöcken bleiben bei der Anpassung weg: zu nah am Haften oder dem Modell fern."),
    (r"No force channel: .*", "Keine Kraft: Effekte von Kontakt und Kraftsensor zeigt nur die Bewegung."),
    (r"No position channel: .*", "Keine Position: Effekte auf das Gleiten sind kaum zu sehen."),
    (r"No actuator channel: .*",
     "Kein Antrieb: Nachgeben und Anlauf des Antriebs sind kaum von Dämpfung zu unterscheiden."),
    (r"One direction only: .*", "Nur eine Richtung: Neigung und Richtungsabhängigkeit sind nicht zu sehen."),
    (r"One velocity only: .*",
     "Nur eine Geschwindigkeit: was von ihr abhängt, ist kaum auseinanderzuhalten."),
    (r"One mass only: .*",
     "Nur eine Masse: Masse und Steifigkeit, Neigung und Rückstellkraft heben sich weniger voneinander ab."),
    (r"The mass of (\d+) shots is not stated and is fitted\.",
     r"Die Masse ist nicht angegeben und wird angepasst (Stöße: \1)."),
    (r"No replicates: .*",
     "Keine Wiederholungen: das Rauschen ist nur eine untere Schranke, Abweichung (b) gibt es nicht."),
    (r"Shot (\d+) has a gap in time; .*",
     r"Stoß \1 hat eine Lücke in der Zeit; was darin geschah, ist verloren."),
    (r"Samples before contact \(pretrigger\) of (\d+) shots are left out of the fits\.",
     r"Messwerte vor dem Kontakt (Stöße: \1) werden nicht angepasst."),
)  # fmt: skip
"""Notes on the data."""


def phrase(identifier: str) -> str:
    """Name an effect, a phase, a covariate or a verdict."""
    if (german := german_texts(identifier)) is not None:
        return german.name
    return _WORDS.get(identifier, identifier.replace("_", " "))


def label(english: str) -> str:
    """Say a label of a figure; KeyError where it has not been put into German."""
    return _LABELS[english]


def setting(english: str) -> str:
    """Say a setting of the next experiment."""
    return _in_german(english, _SETTINGS)


def shape(english: str) -> str:
    """Say what is left along a phase."""
    return _in_german(english, _SHAPES)


def written(text: str) -> str:
    """Write the numbers of a text as the language does."""
    return with_decimal_commas(text)


def note(english: str) -> tuple[str, str]:
    """Say a note on the data: in which language, and the note."""
    for pattern, german in _NOTES:
        said, found = re.subn(f"^{pattern}$", german, english)
        if found:
            return "de", written(said)
    return "en", english


def _in_german(text: str, pairs: Any) -> str:
    for pattern, german in pairs:
        text = re.sub(pattern, german, text)
    return written(text)


def headline(result: DiscrepancyResult) -> str:
    """Say what is established, what remains, and which law would explain it, if one was found."""
    return german_headline(result_document(result))


def noise_floor_sentence(result: DiscrepancyResult) -> str:
    """Say what a noise floor is, in the numbers of this campaign."""
    units = zip(CHANNELS, result.floor.noise_std, (1.0, 1e6, 1e6), ("N", "µm", "µm"), strict=True)
    noise = [
        f"{phrase(channel)} {scale * std:.3g} {unit}"
        for channel, std, scale, unit in units
        if not math.isnan(std)
    ]
    return written(
        "Eine Rauschschwelle ist der Unterschied zwischen Modell und Messung, den allein das Rauschen der "
        f"Sensoren macht (Standardabweichung von {', '.join(noise)}). Eine Abweichung von 1 hat ein Modell, "
        f"dem nichts fehlt; bei {result.validation.gap_before:.2f} liegt es so viel mal weiter weg."
    )


def advice(result: DiscrepancyResult) -> list[dict[str, Any]]:
    """Say of each missing effect, and of what is tied with it, what it means and what to look at."""
    rows = []
    for effect in result.added:
        for place, name in enumerate((effect, *result.selection.ties.get(effect, ()))):
            told = find_effect(name)
            if told.meaning:
                said = told.german or German(name, told.meaning, told.look_at)
                rows.append(
                    {
                        "name": phrase(name),
                        "is_rival": place > 0,
                        "meaning": said.meaning,
                        "look_at": said.look_at,
                    }
                )
    return rows


def next_step(result: DiscrepancyResult) -> str:
    """Say what to measure where no two effects have to be told apart."""
    conclusion = result.conclusion
    if conclusion.verdict == UNTESTED:
        return f"etwa {conclusion.missing_shots} Stöße mehr, mit Einstellungen wie diesen"
    if conclusion.remaining.explained:
        return "nichts weiter; ob es so bleibt, zeigt die Abweichung auf der Seite der Zelle"
    place = result.unexplained or next(iter(conclusion.remaining.where), None)
    if place is None:
        return "dasselbe noch einmal: zurückgehaltene Stöße sagen noch nicht, wo etwas bleibt"
    varied = " und ".join(phrase(name) for name in place.depends_on if name not in NOT_SET)
    what = f"mehr Werte von {varied}, alles andere unverändert" if varied else "dasselbe noch einmal"
    return f"{what}; was bleibt, liegt in der Phase {phrase(place.phase)}"


def split_sentence(result: DiscrepancyResult) -> str:
    """How far contact and slide of taps stay from the floor when each is fitted alone; empty if unknown."""
    alone = result.unexplained.split_fits if result.unexplained else None
    if alone is None or math.isnan(alone.contact + alone.slide):
        return ""
    return written(
        f" Getrennt angepasst bleiben die Kontakte bei {alone.contact:.2f} Rauschschwellen, das Gleiten "
        f"danach bei {alone.slide:.2f}."
    )


def law_sentences(result: DiscrepancyResult) -> dict[str, Any] | None:
    """Say what the page tells of a law that nobody had listed; None where none was looked for."""
    told = sentences.law_sentences(result)
    if told is None or result.law is None:
        return None
    of_factors = result.law.term.form.is_between_shots
    tested = [
        f"{phrase(printed(name))} von {low:.3g} bis {high:.3g}{'' if unit == '1' else f' {unit}'}"
        for name, unit, (low, high) in result.law.term.tested
    ]
    return told | {
        "subject": "die Streuung der Reibungsfaktoren" if of_factors else "die Verläufe",
        "tested": written(" und ".join(tested)),
    }
