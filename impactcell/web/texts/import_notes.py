"""What `impactcell import` noted of dropped files, and `estimate` of their shots, as the page says it.

Options of the command line are left out.
"""

import re
from typing import Final

from impactcell.german.data_faults import german_data_fault
from impactcell.german.findings import with_decimal_commas

OPTION: Final = re.compile(r" \(--[^)]*\)|; give --set .*")
"""A way out on the command line; the page has a form for it."""
GERMAN: Final = {
    r"the lines beside the columns say: (.+)": r"die Zeilen neben den Spalten sagen: \1",
    r"excitation tap: the force is a short push": "Anregung Stoß: die Kraft wirkt nur kurz",
    r"excitation free_slide: no force was recorded": "Anregung freies Gleiten: keine Kraft aufgezeichnet",
    r"excitation driven: the force acts all the time or both ways":
        "Anregung durch eine Kraft, die ständig oder in beiden Richtungen wirkt",
    r"the position is a short push, as the force of a tap is, and the force stays .*":
        "die Position ist ein kurzer Stoß wie sonst die Kraft, und die Kraft bleibt am Ende, wie sonst "
        "die Position: beide scheinen vertauscht",
    r"given, and not used, for it is of taps: (.+)":
        r"angegeben und nicht verwendet, weil es nur für Stöße gilt: \1",
    r"velocity (\S+) mm/min taken from the actuator channel about contact, in (\d+) taps?":
        r"Geschwindigkeit \1 mm/min, aus dem Weg des Aktors um den Kontakt (Stöße: \2)",
    r"velocity (\S+) to (\S+) mm/min taken from the actuator channel about contact, in (\d+) taps?":
        r"Geschwindigkeit \1 bis \2 mm/min, aus dem Weg des Aktors um den Kontakt (Stöße: \3)",
    r"force of (\S+) N without contact taken off, in (\d+) taps?":
        r"Kraft von \1 N ohne Berührung abgezogen (Stöße: \2)",
    r"force of (\S+) to (\S+) N without contact taken off, in (\d+) taps?":
        r"Kraft von \1 bis \2 N ohne Berührung abgezogen (Stöße: \3)",
    r"force turned: it was negative in compression": "Kraft umgekehrt: sie war bei Druck negativ",
    r"force turned in (\d+) of (\d+) contacts: its sign goes with the direction of motion":
        r"Kraft bei \1 von \2 Berührungen umgekehrt: ihr Vorzeichen geht mit der Bewegungsrichtung",
    r"force that pulls, by the sign that was given, in 1 record, (.+)":
        r"Kraft, die mit dem angegebenen Vorzeichen zieht, in 1 Aufzeichnung, \1",
    r"force that pulls, by the sign that was given, in (\d+) records, the first (.+)":
        r"Kraft, die mit dem angegebenen Vorzeichen zieht, in \1 Aufzeichnungen, zuerst \2",
    r"position summed up from the speed (['\"])(.+)\1, from 0 at the first sample of each record: where that "
    r"was is not known":
        r"Position aus der Geschwindigkeit „\2“ aufsummiert, ab 0 beim ersten Messwert jeder Aufzeichnung: "
        "wo das war, ist nicht bekannt",
    r"put together: (.+) and (.+), their times are taken to begin at one moment":
        r"zusammengefügt: \1 und \2, ihre Zeiten gelten als gleichzeitig begonnen",
    r"put together: (.+) and (.+), their times are taken to begin at one moment; (\d+) more likewise":
        r"zusammengefügt: \1 und \2, ihre Zeiten gelten als gleichzeitig begonnen; \3 weitere ebenso",
    r"put together: (.+) and (.+), by the moments that they say, (\S+) s apart":
        r"zusammengefügt: \1 und \2, nach den Zeitpunkten darin, \3 s auseinander",
    r"put together: (.+) and (.+), by the moments that they say, (\S+) s apart; (\d+) more likewise":
        r"zusammengefügt: \1 und \2, nach den Zeitpunkten darin, \3 s auseinander; \4 weitere ebenso",
    r"(\d+) records cut into (\d+) taps where the force begins anew":
        r"\1 Aufzeichnungen in \2 Stöße geteilt, wo die Kraft neu beginnt",
    r"(.+): contact at (\S+) s and, after the part lay still, at (\S+) s, taken for one tap, in (\d+) "
    r"records?: with the stroke, two taps are cut where the actuator had halted":
        r"\1: Kontakt bei \2 s und, nachdem das Teil ruhte, bei \3 s, für einen Stoß genommen "
        r"(Aufzeichnungen: \4); mit dem Hub werden zwei Stöße geteilt, wo der Antrieb schon stand",
    r"(.+): contact at (\S+) s and, after the part lay still, at (\S+) s, taken for one tap, in (\d+) "
    r"records?: the actuator may still have been under way; if these are two taps, cut the file between them":
        r"\1: Kontakt bei \2 s und, nachdem das Teil ruhte, bei \3 s, für einen Stoß genommen "
        r"(Aufzeichnungen: \4): der Antrieb kann noch unterwegs gewesen sein; sind es zwei Stöße, die Datei "
        "dazwischen teilen",
    r"t = 0 put where the force begins, in (\d+) taps?, good to a part of the sampling step of (\S+) ms; "
    r"what lies before is kept as pretrigger":
        r"t = 0 liegt, wo die Kraft beginnt (Stöße: \1), genau auf einen Teil des Abtastschritts von \2 ms; "
        "was davor liegt, bleibt erhalten",
    r"contact is there from the first sample on in (\d+) taps?: that is taken for t = 0":
        r"Kontakt ab dem ersten Messwert (Stöße: \1): dieser gilt als t = 0",
    r"taps left out whose beginning was not recorded: (\d+), in (.+)":
        r"weggelassene Stöße, deren Beginn nicht aufgezeichnet wurde: \1, in \2",
    r"taps left out whose beginning was not recorded: (\d+), the first in (.+)":
        r"weggelassene Stöße, deren Beginn nicht aufgezeichnet wurde: \1, zuerst in \2",
    r"records left out whose force shows no contact(?: of \S+ N)?: (\d+), in (.+): the tap may have missed":
        r"weggelassene Aufzeichnungen, deren Kraft keine Berührung zeigt: \1, in \2: der Stoß ging "
        "vielleicht daneben",
    r"records left out whose force shows no contact(?: of \S+ N)?: (\d+), the first in (.+): the tap may "
    r"have missed":
        r"weggelassene Aufzeichnungen, deren Kraft keine Berührung zeigt: \1, zuerst in \2: der Stoß ging "
        "vielleicht daneben",
    r"positions left out of before the part was put to where it is struck, in (\d+) taps?":
        r"weggelassene Positionen von vor dem Zurücklegen des Teils (Stöße: \1)",
    r"rows left out that stand twice: (\d+), in (.+)": r"weggelassene Zeilen, die doppelt stehen: \1, in \2",
    r"rows left out that stand twice: (\d+), the first in (.+)":
        r"weggelassene Zeilen, die doppelt stehen: \1, zuerst in \2",
    r"no samples before contact: the records' own t = 0 is taken":
        "keine Messwerte vor dem Kontakt: es gilt das t = 0 der Aufzeichnungen",
    r"no stroke is stated: the actuator is taken to halt as it loses contact":
        "kein Hub angegeben: der Antrieb gilt als angehalten, wenn der Kontakt endet",
    r"no mass is stated in its unit: it is fitted, and only friction over mass is seen":
        "keine Masse mit ihrer Einheit angegeben: sie wird angepasst, zu sehen ist nur Reibung durch Masse",
    r"(\w+) (\S+ \S+), as given, goes before what the files say: (.+)":
        r"angegeben, und es gilt: \1 \2; in den Dateien steht \3",
    r"(\w+) (\S+ \S+), as given, goes before what the files say without a unit: (.+)":
        r"angegeben, und es gilt: \1 \2; in den Dateien steht ohne Einheit \3",
    r"the line (['\"])(.+)\1 says (.+) without a unit and is not used, in 1 file":
        r"die Zeile „\2“ sagt \3 ohne Einheit und zählt nicht, in 1 Datei",
    r"the line (['\"])(.+)\1 says (.+) without a unit and is not used, in (\d+) files, the first (.+)":
        r"die Zeile „\2“ sagt \3 ohne Einheit und zählt nicht, in \4 Dateien, zuerst in \5",
    r"the line (['\"])(.+)\1 says (.+), which is no \w+, and is not used, in 1 file":
        r"die Zeile „\2“ sagt \3, keine passende Einheit, und zählt nicht, in 1 Datei",
    r"the line (['\"])(.+)\1 says (.+), which is no \w+, and is not used, in (\d+) files, the first (.+)":
        r"die Zeile „\2“ sagt \3, keine passende Einheit, und zählt nicht, in \4 Dateien, zuerst in \5",
    r"no mass is stated: it is fitted, and only friction over mass is seen":
        "keine Masse angegeben: sie wird angepasst, zu sehen ist nur Reibung durch Masse",
    r"no mass is stated: a base model has to say it \(mass_kg\), else it is fitted":
        "keine Masse angegeben: ein Grundmodell muss sie nennen (mass_kg), sonst wird sie angepasst",
    r"no mass is stated in its unit: a base model has to say it \(mass_kg\), else it is fitted":
        "keine Masse mit ihrer Einheit angegeben: ein Grundmodell muss sie nennen (mass_kg), sonst wird sie "
        "angepasst",
    r"no inertia is stated: the base model has to say it \(inertia_kg_m2\)":
        "keine Trägheit angegeben: das Grundmodell muss sie nennen (inertia_kg_m2)",
    r"no mass is stated in (\d+) of (\d+) records, the first (.+): it is left empty there":
        r"in \1 von \2 Aufzeichnungen ist keine Masse angegeben, zuerst in \3: dort bleibt sie leer",
    r"column (['\"])(.+)\1 is in (\d+) of (\d+) files only: left empty for the others, the first (.+)":
        r"Spalte „\2“ steht nur in \3 von \4 Dateien: in den anderen leer, zuerst in \5",
    r"(.+) is (\S+), where about 1 is possible: check the unit of (.+) or (\S+) "
    r"\(off by a factor of about (\S+)\); it will be refused as it stands":
        r"Einheit prüfen: \3 oder \4 (um etwa den Faktor \5 daneben); so wird es später abgelehnt",
    r"(.+) is 0, where about 1 is possible: check the unit of (.+) or (\S+); it will be refused as it stands":
        r"Einheit prüfen: \2 oder \3 (die Kampagne zeigt keine Bewegung); so wird es später abgelehnt",
    r"(.+): has the samples of (.+), noise and all, and counts as shots of its own; .*":
        r"\1: hat die Messwerte von \2, samt Rauschen, und zählt als eigene Stöße; ist es eine Kopie, "
        "weglassen",
    r"no position was recorded: such taps tell mu_s by peak force and the model of a cell, .*":
        "keine Position aufgezeichnet: solche Stöße zeigen mu_s an der Spitzenkraft und mit dem Modell einer "
        "Zelle, von sich aus keines",
    r"mu_k goes with direction: (.+) in (\d+) shots along \+1, (.+) in (\d+) shots along -1: friction "
    r"differs by direction, or the surface is not level; a mean of both is that of neither":
        r"µk hängt von der Richtung ab: \1 in \2 Aufzeichnungen in Richtung +1, \3 in \4 in Richtung -1: die "
        "Reibung ist richtungsabhängig, oder die Fläche liegt nicht waagrecht; ein Mittel über beide ist "
        "keines von beiden",
    r"no plant could be fitted, mu_k alone is given, by the slides: .*":
        "es ließ sich kein Modell anpassen, es bleibt µk aus dem Gleiten; warum, steht bei jedem Stoß",
    r"named '(.+)', unit fits": r"heißt „\1“, Einheit passt",
    r"named '(.+)'": r"heißt „\1“",
    r"the only column in (\S+)": r"einzige Spalte in \1",
    r"none of the known quantities": "keine der bekannten Größen",
    r"a speed, as the position has it": "eine Geschwindigkeit, wie sie aus der Lage folgt",
    r"an acceleration, as the position has it": "eine Beschleunigung, wie sie aus der Lage folgt",
    r"a coordinate beside '(.+)', as of a film; of what swings export the angle":
        r"eine Koordinate neben „\1“ wie aus einem Film; von dem, was pendelt, den Winkel ausgeben",
    r"it swings to and fro; of a pendulum give the angle": "es pendelt: von einem Pendel den Winkel angeben",
    r"(\d+) of (\d+) records swing; of a pendulum give the angle":
        r"\1 von \2 Aufzeichnungen pendeln: von einem Pendel den Winkel angeben",
    r"of joint (\d+), one of (\d+)": r"von Gelenk \1, einem von \2",
    r"of joint (\d+), not of joint (\d+)": r"von Gelenk \1, nicht von Gelenk \2",
    r"'(.+)' may have driven what is taken to move freely: .*":
        r"„\1“ könnte angetrieben haben, was hier als frei bewegt gilt: dann als Kraft angeben, mit dem, "
        "wofür es steht",
    r"counts the rows": "zählt die Zeilen",
    r"goes by equal steps, as a time does": "wächst um gleiche Schritte wie eine Zeit",
    r"given": "angegeben",
}  # fmt: skip
"""Notes and reasons as patterns; what is in none of them stays English."""
WORDS: Final = {
    "mass": "Masse", "velocity": "Geschwindigkeit", "stroke": "Hub", "direction": "Richtung",
    "trigger": "Kraft bei Berührung", "to": "bis",
}  # fmt: skip
"""What was given for all shots, and what a note on the lines beside the columns is made of."""
OF_WORDS: Final = re.compile(r"(?:sagen|gilt): ")
"""Behind it stand such words."""


def page_note(note: str, language: str) -> tuple[str, str]:
    """Give the language of a note on the page, and the note.

    >>> page_note("force turned: it was negative in compression (--sign force=1 leaves it)", "en")
    ('en', 'force turned: it was negative in compression')
    >>> page_note("the lines beside the columns say: mass 12.5 to 15 kg", "de")
    ('de', 'die Zeilen neben den Spalten sagen: Masse 12,5 bis 15 kg')
    """
    text = OPTION.sub("", note)
    if language == "de" and (data_fault := german_data_fault(text)) is not None:
        return "de", with_decimal_commas(data_fault).removesuffix(".")
    for pattern, german in GERMAN.items() if language == "de" else ():
        match = re.fullmatch(pattern, text)
        if match is not None:
            told = match.expand(german)
            if OF_WORDS.search(german):
                told = re.sub(rf"\b({'|'.join(WORDS)})\b", lambda word: WORDS[word[0]], told)
            return "de", with_decimal_commas(told)
    return "en", text.removesuffix(".")
