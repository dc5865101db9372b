"""What is wrong with numbers in the cells of dropped files, as the page says it."""

from typing import Final

from impactcell.web.texts.fault_pattern import COLUMN, FaultPattern

CELL: Final = r"(?P<mark>['\"])(?P<cell>.*)(?P=mark)"
"""A cell, as Python quotes it."""

FAULTS_OF_CELLS: Final = (
    FaultPattern(
        r"the header again; delete the line.*",
        "the header again; delete the line",
        "noch einmal die Kopfzeile; die Zeile löschen",
    ),
    FaultPattern(
        r"has a JSON object in each line, which is not read; .*",
        "has a JSON object in each line, which is not read; write them as one list, [{{...}}, {{...}}], in a "
        "file that ends in .json",
        "hat in jeder Zeile ein JSON-Objekt, was nicht gelesen wird; als eine Liste schreiben, [{{...}}, "
        "{{...}}], in einer Datei, die auf .json endet",
    ),
    FaultPattern(
        COLUMN + ": " + CELL + r" is not a number with decimal point; .*",
        "column “{column}”: “{cell}” is not a number with decimal point; correct the cell, or leave it empty",
        "Spalte „{column}“: „{cell}“ ist keine Zahl mit Dezimalpunkt; die Zelle berichtigen oder leer lassen",
    ),
    FaultPattern(
        COLUMN + ": " + CELL + r" is not a number with decimal comma; .*",
        "column “{column}”: “{cell}” is not a number with decimal comma; correct the cell, or leave it empty",
        "Spalte „{column}“: „{cell}“ ist keine Zahl mit Dezimalkomma; die Zelle berichtigen oder leer lassen",
    ),
    FaultPattern(
        COLUMN + r" \((?P<meaning>\w+)\) is in " + CELL + r", no unit that is known; "
        r"say --unit '.+?=(?P<unit>[^']+)'.*",
        "column “{column}” ({meaning}) is in “{cell}”, no unit that is known; give it in the form below, "
        "{unit} say",
        "Spalte „{column}“ ({meaning}) ist in „{cell}“, keiner bekannten Einheit; unten im Formular angeben, "
        "etwa {unit}",
    ),
    FaultPattern(
        COLUMN + r" is infinite; .*",
        "column “{column}” is infinite; write the number, or leave the cell empty where there is none",
        "Spalte „{column}“ ist unendlich; die Zahl schreiben oder die Zelle leer lassen, wo es keine gibt",
    ),
    FaultPattern(
        COLUMN + r" is infinite, or beyond any measurement, in (?P<rows>\d+) rows; .*",
        "column “{column}” is infinite, or beyond any measurement, in {rows} rows; correct them, or have no "
        "value there",
        "Spalte „{column}“ ist in {rows} Zeilen unendlich oder größer als jede Messung; berichtigen oder "
        "dort keinen Wert ausgeben",
    ),
    FaultPattern(
        COLUMN + r" has numbers like " + CELL + r" beside whole ones up to 999, which may be thousands; .*",
        "column “{column}” has numbers like “{cell}” beside whole ones up to 999, which may be thousands; "
        "export whole numbers without separators, and decimals with as many digits in each",
        "Spalte „{column}“ enthält Zahlen wie „{cell}“ neben ganzen bis 999, vielleicht mit getrennten "
        "Tausendern; ganze Zahlen ohne Trennzeichen ausgeben, Dezimalzahlen alle mit gleich vielen Stellen",
    ),
)
"""Of single cells, and of all of a column."""
