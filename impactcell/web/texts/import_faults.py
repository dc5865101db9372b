"""Why dropped files cannot be read, as the page says it: with its form as the way out, not with options."""

import re
from typing import Final

from impactcell.german.data_faults import german_message
from impactcell.german.findings import GERMAN_PHASES, GERMAN_QUANTITIES, with_decimal_commas
from impactcell.web.texts.fault_pattern import COLUMN, PLACE, FaultPattern
from impactcell.web.texts.faults_between_files import FAULTS_BETWEEN_FILES
from impactcell.web.texts.faults_of_cells import FAULTS_OF_CELLS
from impactcell.web.texts.faults_of_machines import FAULTS_OF_MACHINES
from impactcell.web.texts.faults_of_taps import FAULTS_OF_TAPS
from impactcell.web.texts.faults_of_times import FAULTS_OF_TIMES
from impactcell.web.texts.import_notes import page_note
from impactcell.web.texts.service_faults import SERVICE_FAULTS

FAULTS: Final = (
    *SERVICE_FAULTS,
    *FAULTS_BETWEEN_FILES,
    *FAULTS_OF_CELLS,
    *FAULTS_OF_TIMES,
    *FAULTS_OF_TAPS,
    *FAULTS_OF_MACHINES,
    FaultPattern(
        r"(?P<cells>\d+) cells where the header has (?P<names>\d+)",
        "{cells} cells where the header has {names}",
        "{cells} Zellen, die Kopfzeile hat {names}",
    ),
    FaultPattern(r"and (?P<count>\d+) more faults", "and {count} more faults", "und {count} weitere Fehler"),
    FaultPattern(
        r"the line (['\"])(?P<line>.+)\2 may say (?P<one>\S+) or (?P<other>\S+); write it so.*",
        "the line “{line}” may say {one} or {other}; write it so, or give it for all shots in the form below",
        "die Zeile „{line}“ kann {one} oder {other} heißen; so schreiben oder unten im Formular für alle "
        "Stöße angeben",
    ),
    FaultPattern(
        r"the line (['\"])(?P<line>.+)\2 says (?P<text>.+) without a unit and is not used; write it as .*",
        "the line “{line}” says {text} without a unit and is not used; write it with its unit, or give it "
        "for all shots in the form below",
        "die Zeile „{line}“ sagt {text} ohne Einheit und zählt nicht; mit Einheit schreiben oder unten im "
        "Formular für alle Stöße angeben",
    ),
    FaultPattern(
        r"the line (['\"])(?P<line>.+)\2 says (?P<text>.+), which is no (?P<meaning>\w+), and is not used; "
        r"write it as .*",
        "the line “{line}” says {text}, which is no {meaning}, and is not used; write it in its unit, or "
        "give it for all shots in the form below",
        "die Zeile „{line}“ sagt {text}, keine passende Einheit, und zählt nicht; in einer passenden "
        "schreiben oder unten im Formular für alle Stöße angeben",
    ),
    FaultPattern(
        r"channel (['\"])(?P<column>.+)\2 of group (['\"])(?P<group>.+)\4 does not say at which moment .*",
        "channel “{column}” of group “{group}” does not say at which moment it begins, where others of the "
        "file begin at different ones; give it its wf_start_time, or export all with one time",
        "Kanal „{column}“ der Gruppe „{group}“ sagt nicht, wann er beginnt, andere der Datei beginnen aber "
        "zu verschiedenen Zeiten; ihm seine wf_start_time geben oder alle mit einer Zeit ausgeben",
    ),
    FaultPattern(
        r"its (?P<key>scale_factor|add_offset) is (['\"])(?P<value>.*)\3, where one number .*",
        "its {key} is “{value}”, where one number is needed; correct it, or apply it and remove "
        "the attribute",
        "{key} ist „{value}“, muss aber eine Zahl sein; berichtigen, oder damit umrechnen und das Attribut "
        "entfernen",
    ),
    FaultPattern(
        r"stroke is (['\"]).+\2: a stroke of (?P<value>\S+) mm is hardly meant, where taps have "
        r"(?P<low>\S+) to (?P<high>\S+) mm: .*",
        "a stroke of {value} mm is hardly meant, where taps have {low} to {high} mm; correct it in the form "
        "below",
        "ein Hub von {value} mm ist kaum gemeint, Stöße haben {low} bis {high} mm; unten im Formular "
        "berichtigen",
    ),
    FaultPattern(
        r"is empty; leave the file out, .*",
        "is empty; leave the file out, or record it again",
        "ist leer; die Datei weglassen oder neu aufzeichnen",
    ),
    FaultPattern(
        r"has no samples below its names; .*",
        "has no samples below its names; leave the file out, or record it again",
        "hat unter den Namen keine Messwerte; die Datei weglassen oder neu aufzeichnen",
    ),
    FaultPattern(r"has no rows", "has no rows", "hat keine Zeilen"),
    FaultPattern(
        r"neither position nor force was found among (?P<names>.+); name them .+, or, where the names are .*",
        "neither position nor force was found among {names}; where the names are others, save the file as "
        "UTF-8, else choose their columns in the form below",
        "weder Position noch Kraft gefunden unter {names}: heißen die Spalten anders, die Datei als UTF-8 "
        "speichern, sonst sie unten im Formular wählen",
    ),
    FaultPattern(
        r"neither position nor force was found among (?P<names>.+); name them with --column .*",
        "neither position nor force was found among {names}; choose their columns in the form below",
        "weder Position noch Kraft gefunden unter {names}: ihre Spalten unten im Formular wählen",
    ),
    FaultPattern(
        COLUMN + r" \((?P<meaning>\w+)\) has no unit; say --unit '.+?=(?P<unit>[^']+)'.*",
        "column “{column}” ({meaning}) has no unit; give it in the form below, {unit} say",
        "Spalte „{column}“ ({meaning}) hat keine Einheit; unten im Formular angeben, etwa {unit}",
    ),
    FaultPattern(
        COLUMN + r" \((?P<meaning>\w+)\) is in (?P<unit>.+?); (?:give its unit|say what that|say --unit) .*",
        "column “{column}” ({meaning}) is in {unit}; give its unit in the form below, or choose the "
        "right column",
        "Spalte „{column}“ ({meaning}) ist in {unit}; unten im Formular ihre Einheit angeben oder "
        "die richtige Spalte wählen",
    ),
    FaultPattern(
        COLUMN + r" may be the (?P<meaning>\w+) \((?P<reason>.*)\); confirm it with --column .*",
        "column “{column}” may be the {meaning} ({reason}); confirm it in the form below, or choose "
        "the right one",
        "Spalte „{column}“ könnte „{meaning}“ sein ({reason}); unten im Formular bestätigen oder die "
        "richtige wählen",
    ),
    FaultPattern(
        COLUMN + r" is called as the (?P<meaning>\w+), but is in (?P<unit>.+?); .*",
        "column “{column}” is called as the {meaning}, but is in {unit}; give its unit in the form "
        "below, or choose the right column",
        "Spalte „{column}“ heißt wie „{meaning}“, ist aber in {unit}; unten im Formular ihre Einheit "
        "angeben oder die richtige Spalte wählen",
    ),
    FaultPattern(
        COLUMN
        + r" holds (?P<dates>dates|days) (?P<what>[a-z ]+), as (?P<cell>.+), where the time is needed; "
        r"(?P<way>.+), or leave the column out with .*",
        "column “{column}” holds {dates} {what}, as {cell}; {way}, or choose another time in the form below",
        "Spalte „{column}“ enthält {dates}, etwa {cell}; {way}, oder unten im Formular eine andere Zeit "
        "wählen",
    ),
    FaultPattern(
        COLUMN + r" holds text, as (?P<cell>.+), where the (?P<meaning>\w+) is needed; .*",
        "column “{column}” holds text, as {cell}, where the {meaning} is needed; correct the cell, or choose "
        "another column as the {meaning} in the form below",
        "Spalte „{column}“ enthält Text, etwa {cell}, wo „{meaning}“ nötig ist; die Zelle berichtigen oder "
        "unten im Formular eine andere Spalte dafür wählen",
    ),
    FaultPattern(
        COLUMN + r" holds units in its cells, as (?P<cell>.+), where the (?P<meaning>\w+) is needed; .*",
        "column “{column}” holds units in its cells, as {cell}, where the {meaning} is needed; put the unit "
        "behind the name of the column, or choose another column as the {meaning} in the form below",
        "Spalte „{column}“ enthält Einheiten in den Zellen, etwa {cell}, wo „{meaning}“ nötig ist; die "
        "Einheit hinter den Namen der Spalte setzen oder unten im Formular eine andere Spalte dafür wählen",
    ),
    FaultPattern(
        r"has no (?P<meanings>[a-z ]+), which a campaign of excitation (?P<kind>\w+) needs; where "
        r"(?P<quote>['\"])(?P<column>.+?)(?P=quote) is the speed .*",
        "has no {meanings}, which a campaign of excitation {kind} needs; where “{column}” is the speed of "
        "what moves, choose it as the position in the form below, and it is summed up",
        "ohne „{meanings}“, für Anregung „{kind}“ nötig; ist „{column}“ die Geschwindigkeit dessen, was sich "
        "bewegt, sie unten im Formular als Position wählen: sie wird aufsummiert",
    ),
    FaultPattern(
        r"has no (?P<meanings>[a-z ]+), which a campaign of excitation (?P<kind>\w+) needs; name the .*",
        "has no {meanings}, which a campaign of excitation {kind} needs; choose the column in the form below",
        "ohne „{meanings}“, für Anregung „{kind}“ nötig; die Spalte unten im Formular wählen",
    ),
    FaultPattern(
        COLUMN + r" is a speed, whose noise adds up in a position; .*",
        "column “{column}” is a speed, whose noise adds up in a position; of a tap the position has to be "
        "measured: choose another column in the form below",
        "Spalte „{column}“ ist eine Geschwindigkeit, deren Rauschen sich in der Position aufsummiert; bei "
        "einem Stoß muss die Position gemessen sein: unten im Formular eine andere Spalte wählen",
    ),
    FaultPattern(
        r"the times are those of " + COLUMN + r", so that the rate has no use; .*",
        "the times are those of column “{column}”, so that the rate has no use; take it out of the "
        "form below",
        "die Zeiten stehen in Spalte „{column}“, die Abtastrate hat keinen Zweck; aus dem Formular nehmen",
    ),
    FaultPattern(
        COLUMN + r" has (?P<values>\d+) values in (?P<rows>\d+) rows, so it does not number shots; .*",
        "column “{column}” has {values} values in {rows} rows, so it does not number shots; choose "
        "another in the form below",
        "Spalte „{column}“ hat {values} Werte in {rows} Zeilen, zählt also keine Stöße; unten im "
        "Formular eine andere wählen",
    ),
    FaultPattern(
        COLUMN
        + r" \((?P<meaning>\w+)\) is (?P<one>.+) and (?P<other>.+) within one record, where a shot has "
        r"one; .*",
        "column “{column}” ({meaning}) is {one} and {other} within one record, where a shot has one; "
        "choose the column that numbers the shots in the form below, or give one value for all of "
        "them",
        "Spalte „{column}“ ({meaning}) hat {one} und {other} in einer Aufzeichnung, ein Stoß aber "
        "nur einen Wert: unten im Formular die Spalte wählen, die Stöße zählt, oder einen Wert für "
        "alle angeben",
    ),
    FaultPattern(
        r"(?:"
        + COLUMN
        + r" \()?(?P<meaning>\w+)\)? is (?P<value>.+); it has to be (?P<needed>.+): correct it, or .*",
        "{meaning} is {value}; it has to be {needed}; correct it, or give it for all shots in the form below",
        "{meaning} ist {value}, muss aber {needed} sein; berichtigen oder unten im Formular für alle "
        "Stöße angeben",
    ),
    FaultPattern(
        r"the lines beside the columns say (?P<meaning>\w+) (?P<one>.+) and (?P<other>.+); give it .*",
        "the lines beside the columns say {meaning} {one} and {other}; give it for all shots in the form "
        "below",
        "die Zeilen neben den Spalten sagen {meaning} {one} und {other}; unten im Formular für alle Stöße "
        "angeben",
    ),
    FaultPattern(
        r"(?P<units>.+): some are of a rotation and some of a translation; .*",
        "{units}: some are of a rotation and some of a translation; give units that fit in the form below",
        "{units}: teils eine Drehung, teils eine Bewegung längs einer Geraden; unten im Formular passende "
        "Einheiten angeben",
    ),
    FaultPattern(
        r"what turns is no part that slides under its weight: .*",
        "what turns needs a base model, which “impactcell discrepancy --base” takes in a shell",
        "was sich dreht, braucht ein Grundmodell; „impactcell discrepancy --base“ nimmt es in einer Shell",
    ),
    FaultPattern(
        r"the position is a short push, as the force of a tap is, .*",
        "the position is a short push, as the force of a tap is, and the force stays where it went, as a "
        "part does: they look swapped; choose their columns, and give their units, in the form below",
        "die Position ist ein kurzer Stoß wie sonst die Kraft, und die Kraft bleibt am Ende, wie sonst die "
        "Position: beide scheinen vertauscht; unten im Formular ihre Spalten wählen und ihre Einheiten "
        "angeben",
    ),
)
"""What `impactcell import` says, as patterns; what the page says in English, and in German."""
REFUSED: Final = re.compile(
    PLACE + r"shot (?P<shot>\d+): (?P<message>.+) \(and so in all (?P<all>\d+) shots\)", re.DOTALL
)
"""Data of which no shot can be used."""
DATES: Final = {
    "dates": "ein Datum, bei dem Tag und Monat vertauscht sein können",
    "days": "Tage ohne Uhrzeit",
    "write them all as 2024-01-31 10:00:00.000": "überall wie 2024-01-31 10:00:00.000 schreiben",
    "export hours, minutes and fractions of a second with each sample":
        "zu jedem Messwert Stunden, Minuten und Sekundenbruchteile ausgeben",
}  # fmt: skip
"""What keeps dates from being a time, and what to do."""
REASONS: Final = (
    (r": the line (['\"])(?P<line>.+)\1 may say (?P<one>\S+) or (?P<other>\S+)",
     ": die Zeile „{line}“ kann {one} oder {other} heißen"),
    (r": '(?P<column>.+)' holds dates of which [a-z ]+, as '(?P<text>.*)'",
     ": in „{column}“ können Tag und Monat vertauscht sein, etwa „{text}“"),
    (r": '(?P<column>.+)' holds days without a time of day, as '(?P<text>.*)'",
     ": „{column}“ enthält Tage ohne Uhrzeit, etwa „{text}“"),
    (r": '(?P<column>.+)' holds text, as '(?P<text>.*)'", ": „{column}“ enthält Text, etwa „{text}“"),
    (r": '(?P<column>.+)' goes forward in (?P<some>\d+) of (?P<all>\d+) steps only",
     ": „{column}“ wächst nur in {some} von {all} Schritten"),
    (r": '(?P<column>.+)' goes up by (?P<step>\S+) a row and may be it, in a unit to be said",
     ": „{column}“ wächst je Zeile um {step} und könnte sie sein; dann auch die Einheit angeben"),
    (r": its column changes within the record, so it was measured",
     ": ihre Spalte ändert sich in der Aufzeichnung, ist also gemessen"),
)  # fmt: skip
NEEDED: Final = {"above 0": "über 0", "0 or above": "0 oder mehr", "1 or -1": "1 oder -1"}


def page_fault(fault: str, language: str) -> tuple[str, str]:
    """Give the language of a fault on the page, and the fault.

    >>> page_fault("column 'Weg' (position) has no unit; say --unit 'Weg=m', or which it is", "de")
    ('de', 'Spalte „Weg“ (Position) hat keine Einheit; unten im Formular angeben, etwa m')
    """
    for kind in FAULTS:
        match = re.fullmatch(PLACE + kind.pattern, fault)
        if match is None:
            continue
        said = {name: text or "" for name, text in match.groupdict().items()}
        if language == "de":
            said |= _in_german(said)
        return language, said["place"] + (kind.german if language == "de" else kind.english).format_map(said)
    refused = REFUSED.fullmatch(fault)
    german = None if refused is None or language != "de" else german_message(refused["message"])
    if refused is None or german is None:
        return "en", fault
    message = with_decimal_commas(f"Stoß {refused['shot']}: {german}")
    return "de", f"{refused['place']}{message} (und so in allen {refused['all']} Stößen)"


def _german_words(listed: str) -> str:
    words = {**GERMAN_QUANTITIES, "with": "mit", "and": "und"}
    return re.sub(r"\w+", lambda word: words.get(word[0], word[0]), listed)


def _in_german(said: dict[str, str]) -> dict[str, str]:
    meaning, needed = said.get("meaning", ""), said.get("needed", "")
    why = said.get("why", "")
    for pattern, german in REASONS:
        if (match := re.fullmatch(pattern, why)) is not None:
            why = german.format_map(match.groupdict())
    return {
        "meaning": GERMAN_QUANTITIES.get(meaning, meaning),
        "second": GERMAN_QUANTITIES.get(said.get("second", ""), ""),
        "name": GERMAN_QUANTITIES.get(said.get("name", ""), said.get("name", "")),
        **{name: _german_words(said.get(name, "")) for name in ("counts", "units")},
        "meanings": "“ und „".join(
            GERMAN_QUANTITIES.get(name, name) for name in said.get("meanings", "").split(" and no ")
        ),
        "kind": GERMAN_PHASES.get(said.get("kind", ""), said.get("kind", "")),
        "needed": NEEDED.get(needed, needed),
        "reason": page_note(said.get("reason", ""), "de")[1],
        "why": why,
        **{name: DATES.get(said.get(name, ""), "") for name in ("dates", "way")},
    }
