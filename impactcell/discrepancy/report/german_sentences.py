"""What the report says in German; each function says the same as the one of its name in `sentences`."""

import math
import re
from collections.abc import Sequence
from typing import Any, Final

from impactcell.discrepancy.data import CHANNELS
from impactcell.discrepancy.report import sentences
from impactcell.discrepancy.report.german_notes import note
from impactcell.discrepancy.report.german_patterns import Patterns
from impactcell.discrepancy.report.german_reasons import reason
from impactcell.discrepancy.report.german_references import REFERENCES
from impactcell.discrepancy.report.german_words import phrase
from impactcell.discrepancy.report.next_step import Step, plan_next_step
from impactcell.discrepancy.report.planned_experiments import by_effect
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.german.findings import enumerated, german_headline, with_decimal_commas
from impactcell.german.findings import german_equation as equation
from impactcell.physics.effect import German
from impactcell.physics.effects import find_effect
from impactcell.physics.free_column_forms import printed

__all__ = [
    "advice", "equation", "headline", "in_german", "label", "law_sentences", "next_step",
    "noise_floor_sentence", "note", "phrase", "reason", "reference", "setting", "shape", "split_sentence",
    "told_apart", "written",
]  # fmt: skip
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
    "s(u, w) less its mean": "s(u, w) ohne seinen Mittelwert",
    "95 % bands": "95-%-Bänder",
    "below: where samples lie": "unten: wo Messwerte liegen",
    "nominal plant": "Ausgangsmodell",
}
"""Labels of the figures."""
_SETTINGS: Final = (
    (r"^weigh the part: if .*",
     "das Teil wiegen: wiegt es anders als angegeben, die Masse berichtigen, sonst die Skala des Sensors"),
    (r"^weigh the part$", "das Teil wiegen"),
    (r"^load the force sensor .*", "den Kraftsensor mit einem bekannten Gewicht belasten"),
    (r"^the same settings at a higher sampling rate: .*",
     "dasselbe mit höherer Abtastrate: beim ersten Kontakt zeigt sie, was einen Kanal verspätet"),
    (r"^level the table .*",
     "den Tisch mit der Wasserwaage ausrichten und dasselbe noch einmal: was dann bleibt, ist keine Neigung"),
    (r"^repeat the campaign .*",
     "die Kampagne mit anderer Folge von Chargen, Richtungen und Ruhezeiten wiederholen"),
    (r"^the same settings again, column (.+) in another order$",
     r"dieselben Einstellungen noch einmal, die Spalte \1 in anderer Reihenfolge"),
    (r"^record the actuator's position$", "die Position des Antriebs aufzeichnen"),
    (r"^no setting within reach .*",
     "keine erreichbare Einstellung unterscheidet sie: eines von beiden für sich messen"),
    (r"\bdirection ([+-]\d)", r"Richtung \1"),
    (r"\bhalf of them in each direction\b", "je die Hälfte in jeder Richtung"),
    (r"\bafter ([\d.]+) s at rest$", r"nach \1 s Ruhe"),
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


def label(english: str) -> str:
    """Say a label of a figure; KeyError where it has not been put into German."""
    return _LABELS[english]


def told_apart(pairs: Sequence[tuple[str, str]]) -> str:
    """Say which effects an experiment tells from which.

    >>> told_apart([("surface_tilt", "batch_shift"), ("surface_tilt", "friction_drift")])
    '„Neigung des Tisches“ von „Chargenunterschied“ und von „Reibungsdrift“'
    """
    said = [(phrase(name), [f"von „{phrase(one)}“" for one in rivals]) for name, rivals in by_effect(pairs)]
    return ", und ".join(f"„{name}“ {enumerated(rivals, 'und')}" for name, rivals in said)


def setting(english: str) -> str:
    """Say a setting of the next experiment; the name of a batch is as it is.

    >>> setting("batch 7.5 again, after the others")
    'Charge 7.5 noch einmal, nach den anderen'
    """
    batch = re.fullmatch(r"batch (.+) again, after the others", english)
    if batch is None:
        return in_german(english, _SETTINGS)
    name = "ohne Namen" if batch[1] == "without a name" else batch[1]
    return f"Charge {name} noch einmal, nach den anderen"


def reference(english: str) -> str:
    """Say where the law of an effect comes from: what is said of it, not the title of a work.

    >>> reference("Span error: ISO 376 (2011)")
    'Skalenfehler: ISO 376 (2011)'
    """
    return in_german(english, REFERENCES)


def shape(english: str) -> str:
    """Say what is left along a phase."""
    return in_german(english, _SHAPES)


def written(text: str) -> str:
    """Write the numbers of a text as the language does."""
    return with_decimal_commas(text)


def in_german(text: str, pairs: Patterns) -> str:
    """Put those parts of a text into German that are among the patterns."""
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
    step = plan_next_step(result)
    left = "zwischen den Stößen" if step.phase == "between_shots" else f"in der Phase {phrase(step.phase)}"
    varied = " und ".join(phrase(name) for name in step.covariates)
    unit = phrase(result.prepared.excitation.unit)
    told = {
        Step.MORE_SHOTS: f"etwa {step.shots} {unit} mehr, mit Einstellungen wie diesen",
        Step.MASS: (
            "die Masse des Teils, die kein Gleiten zeigt: ohne sie kann keine Zelle mit diesem Modell laufen"
        ),
        Step.REPLICATES: (
            "dasselbe noch einmal: wie weit Reibung zwischen gleichen Messungen streut, ist nicht bekannt"
        ),
        Step.OTHER_DIRECTION: (
            "nichts weiter für Stöße in dieser Richtung; wo auch vom anderen Ende gestoßen wird, etwa "
            f"{step.shots} Stöße von dort: bis dahin gilt eine Neigung oder Asymmetrie als Reibung"
        ),
        Step.NOTHING: "nichts weiter; ob es so bleibt, zeigt die Abweichung auf der Seite der Zelle",
        Step.PLACE: "dasselbe noch einmal: Zurückgehaltenes sagt noch nicht, wo etwas bleibt",
        Step.MORE_OF_DIRECTION: (
            f"etwa {step.shots} weitere Stöße in Richtung {step.direction:+d}, von denen es wenige gibt, "
            f"zu diesen dazu; was bleibt, liegt {left} und hängt von der Richtung ab"
        ),
        Step.BATCHES: (
            "noch nichts Neues: den Stößen jeder Masse in shots.csv eine eigene Charge geben und dies noch "
            "einmal laufen lassen; was bleibt, liegt zwischen den Stößen und hängt von der Masse ab, und "
            "jede Charge hat ihre eigene Reibung"
        ),
        Step.VALUES: f"mehr Werte von {varied}, alles andere unverändert; was bleibt, liegt {left}",
        Step.SAME: f"dasselbe noch einmal; was bleibt, liegt {left}",
    }
    return told[step.step]


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
        "equation": equation(told["equation"]),
        "listed": phrase(law.listed) if (law := result.law.proposed) and law.listed else None,
        "refused": reason(result.law.refused) if result.law.refused else None,
        "subject": "die Streuung der Reibungsfaktoren" if of_factors else "die Verläufe",
        "tested": written(" und ".join(tested)),
    }
