"""Why the times of dropped files cannot be used, as the page says it."""

from typing import Final

from impactcell.web.texts.fault_pattern import COLUMN, FaultPattern

RUNS_BACKWARDS: Final = (
    "column “{column}” (time) runs backwards; turn the rows of the file round, or choose another in the "
    "form below"
)
RUNS_BACKWARDS_GERMAN: Final = (
    "Spalte „{column}“ (Zeit) läuft rückwärts; die Zeilen der Datei umkehren oder unten im Formular eine "
    "andere wählen"
)
ROUNDED: Final = (
    "rounded times do so: export them with more digits, or leave the column out in the form below and give "
    "the sampling rate there"
)
ROUNDED_GERMAN: Final = (
    "so sind gerundete Zeiten: mit mehr Stellen ausgeben, oder unten im Formular die Spalte weglassen und "
    "die Abtastrate angeben"
)
NO_TIME: Final = r"no column of time was found: (?P<quote>['\"])(?P<column>.+)(?P=quote) "
NOT_INCREASING: Final = (
    r"time does not increase: (?P<after>\S+) after (?P<before>\S+) \((?P<rows>\d+) such rows\); "
)

FAULTS_OF_TIMES: Final = (
    FaultPattern(NO_TIME + r"runs backwards; .*", RUNS_BACKWARDS, RUNS_BACKWARDS_GERMAN),
    FaultPattern(COLUMN + r" \(time\) runs backwards; .*", RUNS_BACKWARDS, RUNS_BACKWARDS_GERMAN),
    FaultPattern(
        NO_TIME + r"goes forward in (?P<some>\d+) of (?P<all>\d+) steps and repeats in the others; .*",
        "column “{column}” (time) goes forward in {some} of {all} steps and repeats in the others; "
        + ROUNDED,
        "Spalte „{column}“ (Zeit) wächst nur in {some} von {all} Schritten und wiederholt sich sonst; "
        + ROUNDED_GERMAN,
    ),
    FaultPattern(
        r"no column of time was found(?P<why>.*?)(?:, as --unit '.*')?; name it with --column .*",
        "no column of time was found{why}; choose it in the form below, or give the sampling rate there",
        "keine Zeitspalte gefunden{why}; unten im Formular wählen, oder dort die Abtastrate angeben",
    ),
    FaultPattern(
        r"has no column of time(?P<why>.*?)(?:, as --unit '.*')?; name it, .*",
        "has no column of time{why}; choose it in the form below, or give the sampling rate there",
        "hat keine Zeitspalte{why}; unten im Formular wählen, oder dort die Abtastrate angeben",
    ),
    FaultPattern(
        NOT_INCREASING + r"rounded .*",
        "time does not increase: {after} after {before} ({rows} such rows); " + ROUNDED,
        "die Zeit wächst nicht: {after} nach {before} ({rows} solche Zeilen); " + ROUNDED_GERMAN,
    ),
    FaultPattern(
        NOT_INCREASING + r"(?P<unit>line|row) (?P<line>\d+) is out of order: .*",
        "time does not increase: {after} after {before} ({rows} such rows); {unit} {line} is out of order: "
        "delete it, or sort the rows by their time",
        "die Zeit wächst nicht: {after} nach {before} ({rows} solche Zeilen); Zeile {line} ist an falscher "
        "Stelle: löschen, oder die Zeilen nach der Zeit sortieren",
    ),
    FaultPattern(
        NOT_INCREASING + r"(?P<count>\d+) rows are out of order, the first in (?P<unit>line|row) "
        r"(?P<line>\d+): .*",
        "time does not increase: {after} after {before} ({rows} such rows); {count} rows are out of order, "
        "the first in {unit} {line}: delete them, or sort the rows by time",
        "die Zeit wächst nicht: {after} nach {before} ({rows} solche Zeilen); {count} Zeilen stehen "
        "falsch, die erste ist Zeile {line}: löschen, oder die Zeilen nach der Zeit sortieren",
    ),
    FaultPattern(
        NOT_INCREASING + r"several .*",
        "time does not increase: {after} after {before} ({rows} such rows); several shots in one file need a "
        "column that numbers them: choose it in the form below",
        "die Zeit wächst nicht: {after} nach {before} ({rows} solche Zeilen); mehrere Stöße in einer Datei "
        "brauchen eine Spalte, die sie zählt: unten im Formular wählen",
    ),
)
"""Of these the first that fits is said."""
