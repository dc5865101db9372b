"""Why no law is proposed and no further term named, in German."""

from typing import Final

from impactcell.discrepancy.report.german_held_numbers import column_slip, held_number, key_of
from impactcell.discrepancy.report.german_patterns import Patterns, marked, translated
from impactcell.discrepancy.report.german_words import phrase, term_name
from impactcell.german.parameters import words_of
from impactcell.physics.effect_names import identifier_of

SIZES: Final = {"smallest": "kleinsten", "largest": "größten"}
"""Which end of what is looked for."""
REASONS: Final[Patterns] = (
    (r"of two covariates: (.*)",
     lambda m: f"über zwei Größen: {said}" if (said := translated(m[1], REASONS)) else ""),
    (r"on held-out (?:shots|blocks) the gap does not fall by more than chance",
     "an Zurückgehaltenem fällt die Abweichung nicht mehr als durch Zufall"),
    (r"on held-out shots it says no more than the best function of one by more than chance",
     "an zurückgehaltenen Stößen sagt sie über die beste von einer Größe hinaus nur, was Zufall ist"),
    (r"no second one was gone through far enough", "keine zweite wurde weit genug durchfahren"),
    ((r"the best term, ([^;]*), leaves (\S+)(?: of (\S+))? noise floors: [^;]* no function of ([^;]+?)"
      r"( alone)?"),
     lambda m: f"der beste Term, {m[1]}, lässt {m[2]}{f' von {m[3]}' if m[3] else ''} Rauschschwellen übrig: "
     f"was fehlt, ist keine Funktion {'allein ' if m[5] else ''}von {_in_words(m[4])}"),
    (r"the term would give energy: ([^;]*) becomes negative in the range [^;]*",
     r"der Term gäbe Energie ab: \1 wird im durchfahrenen Bereich negativ, also fehlt etwas anderes"),
    (r"the smoothest spline predicts best, so that the data tell nothing of how the term bends",
     "der glatteste Spline sagt am besten voraus, so dass die Daten nichts von einer Krümmung sagen"),
    (r"shots over a wider range of ([^;]+) would",
     lambda m: f"Stöße über einen größeren Bereich von {_in_words(m[1])} täten es"),
    (r"the columns? ([^;]+) had fewer than (\d+) different values, [^;]*",
     lambda m: f"zu wenig verschiedene Werte für eine Funktion (unter {m[2]}) hatte: "
     f"{m[1].replace(' and ', ' und ')}"),
    ((r"no function of speed, load or position that a spline of (\d+) pieces can follow helps block after "
      r"block that it was not fitted to"),
     (r"keine Funktion von Geschwindigkeit, Last oder Ort, der ein Spline aus \1 Stücken folgen kann, hilft "
      r"in einem Block um den anderen, der nicht angepasst wurde")),
    (r"(an?\w* .+) does as well as any function of speed, load or position",
     lambda m: f"{said} erklärt es so gut wie jede Funktion von Geschwindigkeit, Last oder Ort"
     if (said := held_number(m[1])) else ""),
    (r"(.+) beside (an?\w* .+) does as well as any law",
     lambda m: f"„{term_name(identifier_of(m[1]))}“, dazu {said}, erklärt es so gut wie jedes Gesetz"
     if (said := held_number(m[2])) else ""),
    ((r"(\w+[^;]* among the nuisances of the base model(?: or a free \w+)?|"
      r"a free \w+(?: above 0)? in the base model) would tell"),
     lambda m: f"{key_of(m[1])} zeigte es"),
    (r"simulated open loop, the law that fits best errs no less on held-out records than no law",
     "ohne Rückführung simuliert irrt das beste Gesetz an Zurückgehaltenem nicht weniger als keines"),
    (r"simulated open loop, the law that fits best errs more on held-out records than a constant",
     "ohne Rückführung simuliert irrt das beste Gesetz an Zurückgehaltenem mehr als eine Konstante"),
    ((r"the law that fits best stands in for the drive: with it the inertia would be (\S+) times what it is "
      r"without"),
     r"das beste Gesetz steht für den Antrieb: Mit ihm wäre die Trägheit das \1-fache von der ohne"),
    (r"with the law that fits best friction would give energy in the range that was gone through",
     "mit dem besten Gesetz gäbe die Reibung im durchfahrenen Bereich Energie ab"),
    (r"no term does better in block after block that it was not fitted to",
     "kein Term ist in einem Block um den anderen besser, der nicht angepasst wurde"),
    (r"no term closes a fifth of the gap", "kein Term schließt ein Fünftel der Abweichung"),
    (r"(an?\w* .+) would explain as much as the best term",
     lambda m: f"{said} würde ebenso viel erklären wie der beste Term"
     if (said := held_number(m[1])) else ""),
    (r"(an?\w* .+) would explain more than the best term",
     lambda m: f"{said} würde mehr erklären als der beste Term" if (said := held_number(m[1])) else ""),
    (r"(an?\w* .+) would explain (\d+) % of it",
     lambda m: f"{said} erklärte {m[2]} % davon" if (said := held_number(m[1])) else ""),
    (r"with (.+) the base model, simulated open loop, errs (\S+) times as much",
     lambda m: f"mit {column_slip(m[1])} irrt das Grundmodell, ohne Rückführung simuliert, {m[2]}-mal so "
     "viel"),
    (r"no term stands out from what all of them close together",
     "kein Term hebt sich von dem ab, was alle zusammen schließen"),
    (r"(.+) comes nearest, at a (.+) of (\S+) (\S+), the (smallest|largest) that is looked for",
     lambda m: f"„{term_name(identifier_of(m[1]))}“ kommt am nächsten, mit {m[3]} {m[4]} "
     f"({words_of(identifier_of(m[2]), 'de')}), dem {SIZES[m[5]]} Wert, der gesucht wird"),
    (r"a free form in the same place does much better than any named term",
     "eine freie Form an derselben Stelle ist viel besser als jeder benannte Term"),
    (r"a free form in another place does much better than any named term",
     "eine freie Form an anderer Stelle ist viel besser als jeder benannte Term"),
    (r"a smooth force of position and speed explains these records as well as any named term",
     "eine glatte Kraft über Ort und Geschwindigkeit erklärt diese Messungen so gut wie jeder Term"),
    ((r"beside a smooth force of position and speed what remains needs no law in one place, and that force "
      r"is none either: (.+)"),
     lambda m: "neben einer glatten Kraft über Ort und Geschwindigkeit braucht der Rest kein Gesetz an einer "
     f"Stelle, und diese Kraft ist auch keines: {said}" if (said := translated(m[1], REASONS)) else ""),
    (r"it does not help block after block that it was not fitted to",
     "sie hilft nicht in einem Block um den anderen, der nicht angepasst wurde"),
    (r"the base model has it", "das Grundmodell hat es schon"),
    (r"on these records it looks like inertia, gravity or drive",
     "in diesen Messungen sieht es aus wie Trägheit, Schwerkraft oder Antrieb"),
    (r"another one explains more", "ein anderer Term erklärt mehr"),
    (r"held-out records do not confirm it", "zurückgehaltene Messungen bestätigen es nicht"),
    (r"held-out records do not confirm it \(p = (\S+)\)",
     r"zurückgehaltene Messungen bestätigen es nicht (p = \1)"),
    (r"held-out records want it \(p = (\S+)\), but without it they leave no gap that it could close",
     r"zurückgehaltene Messungen wollen es (p = \1), lassen ohne es aber keine Abweichung, die es schlösse"),
    (r"held-out records want it \(p = (\S+)\), but it closes (\S+) % of their gap, less than counts",
     r"zurückgehaltene Messungen wollen es (p = \1), doch schließt es nur \2 % ihrer Abweichung"),
    ((r"held-out records want it \(p = (\S+)\), but not alike: of their gap it closes (\S+) to (\S+) % "
      r"\(95 %\), which may be nothing"),
     (r"zurückgehaltene Messungen wollen es (p = \1), aber nicht alle: Von ihrer Abweichung schließt es \2 "
      r"bis \3 % (95 %), also vielleicht nichts")),
    (r"held-out blocks want it, but the simulation of held-out records contradicts it",
     "zurückgehaltene Blöcke wollen es, doch die Simulation zurückgehaltener Messungen widerspricht"),
    (r"it was found beside a term that is not confirmed",
     "es wurde neben einem Term gefunden, der nicht bestätigt ist"),
    (r"beside a remainder one term is named at most",
     "neben einem Rest wird höchstens ein Term genannt"),
)  # fmt: skip
"""Why no law is proposed and no further term named: parts of a sentence."""


def reason(english: str) -> tuple[str, str]:
    """Say why nothing is proposed: in which language, and the reason.

    >>> reason("no term closes a fifth of the gap")
    ('de', 'kein Term schließt ein Fünftel der Abweichung')
    >>> reason("no term closes a fifth of the gap; nobody knows why")
    ('en', 'no term closes a fifth of the gap; nobody knows why')
    """
    return marked(english, translated(english, REASONS))


def _in_words(english: str) -> str:
    return " und ".join(phrase(identifier_of(name)) for name in english.split(" and "))
