"""Why files that were dropped together cannot be read: what one says and another does not, or otherwise."""

from typing import Final

from impactcell.web.texts.fault_pattern import COLUMN, FaultPattern

FAULTS_BETWEEN_FILES: Final = (
    FaultPattern(
        r"has no column of time, where (?P<other>.+) has '(?P<column>.+?)', and the rate .*",
        "has no column of time, where {other} has “{column}”, and the rate does not say how the two stand to "
        "each other; export both with their times, and take the rate out of the form below",
        "hat keine Zeitspalte, {other} aber „{column}“, und die Abtastrate sagt nicht, wie beide zueinander "
        "liegen; beide mit ihren Zeiten ausgeben und die Abtastrate aus dem Formular nehmen",
    ),
    FaultPattern(
        COLUMN + r" is in (?P<one>.+) in (?P<first>.+) and in (?P<other>.+) in (?P<second>.+); import the "
        r"files .*",
        "column “{column}” is in {one} in {first} and in {other} in {second}; drop the files one by "
        "one, or give the unit of all in the form below",
        "Spalte „{column}“ ist in {first} in {one} und in {second} in {other}; die Dateien einzeln "
        "ablegen oder unten im Formular eine Einheit für alle angeben",
    ),
    FaultPattern(
        r"has no (?P<meaning>\w+), which (?P<other>.+) has as column (?P<quote>['\"])(?P<column>.+?)"
        r"(?P=quote); call it so here too, .*",
        "has no {meaning}, which {other} has as column “{column}”; call it so here too, or drop the files "
        "one by one",
        "ohne „{meaning}“, in {other} ist sie Spalte „{column}“; die Spalte hier ebenso nennen oder die "
        "Dateien einzeln ablegen",
    ),
    FaultPattern(
        r"has no (?P<meaning>\w+), which (?P<other>.+) says beside its columns; say it here too, .*",
        "has no {meaning}, which {other} says beside its columns; say it here too, or give it for all "
        "shots in the form below",
        "ohne „{meaning}“, in {other} steht der Wert neben den Spalten; hier auch angeben oder unten im "
        "Formular für alle Stöße",
    ),
    FaultPattern(
        COLUMN + r" has no unit that is known, and in (?P<other>.+) it is in (?P<unit>.+); say the unit .*",
        "column “{column}” has no unit that is known, and in {other} it is in {unit}; give the unit of all "
        "in the form below",
        "Spalte „{column}“ hat keine bekannte Einheit, in {other} steht sie in {unit}; unten im Formular "
        "eine Einheit für alle angeben",
    ),
    FaultPattern(
        r"files: (?P<counts>.+); a record is put together of .*",
        "files: {counts}; a record is put together of one of each, so drop as many of each",
        "Dateien: {counts}; eine Aufzeichnung wird aus je einer zusammengefügt, also von jeder Art gleich "
        "viele ablegen",
    ),
    FaultPattern(
        r"holds (?P<shots>\d+) shots, where (?P<other>.+), which it is put together with, holds "
        r"(?P<others>\d+); .*",
        "holds {shots} shots, where {other}, which it is put together with, holds {others}; drop files of "
        "the same shots",
        "enthält {shots} Stöße, die dazugehörige {other} aber {others}; Dateien derselben Stöße ablegen",
    ),
    FaultPattern(
        r"holds shot (?P<shot>.+), where (?P<other>.+), which it is put together with, holds shot "
        r"(?P<beside>.+); .*",
        "holds shot {shot}, where {other}, which it is put together with, holds shot {beside}; drop files of "
        "the same shots",
        "enthält Stoß {shot}, wo die dazugehörige {other} Stoß {beside} enthält; Dateien derselben Stöße "
        "ablegen",
    ),
    FaultPattern(
        r"the (?P<meaning>\w+) was recorded from (?P<one>\S+) to (?P<end>\S+) s and the (?P<second>\w+) from "
        r"(?P<begin>\S+) to (?P<last>\S+) s, so they are not of one record; .*",
        "the {meaning} was recorded from {one} to {end} s and the {second} from {begin} to {last} s, so they "
        "are not of one record; export both with times of one clock",
        "„{meaning}“ wurde von {one} bis {end} s aufgezeichnet, „{second}“ aber von {begin} bis {last} s: "
        "nicht dieselbe Aufzeichnung; beide mit Zeiten einer Uhr ausgeben",
    ),
    FaultPattern(
        r"says (?P<name>.+) (?P<value>\S+) and (?P<other>.+), which it is put together with, "
        r"(?P<others>\S+); .*",
        "says {name} {value} and {other}, which it is put together with, {others}; correct one",
        "sagt {name} {value}, die dazugehörige {other} aber {others}; eine davon berichtigen",
    ),
)
"""Of these what two files or tables have to do with each other."""
