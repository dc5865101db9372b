"""Notes on the data, in German.

Data, laws and machines say theirs in English, for `result.json` too. What no pattern here knows stays as it
was said, and is marked as English.
"""

import re
from typing import Final

from impactcell.discrepancy.report.german_held_numbers import column_slip, held_number, key_of
from impactcell.discrepancy.report.german_patterns import Patterns, marked, translated
from impactcell.discrepancy.report.german_words import phrase, term_name
from impactcell.german.data_faults import german_data_fault, german_message
from impactcell.german.findings import enumerated_names
from impactcell.physics.effect_names import as_title, identifier_of

AT_REST: Final = {"before contact": "vor dem Kontakt", "after the tap": "nach dem Stoß"}
"""When a part lies still."""
SETTINGS: Final = {"velocity": "Die Geschwindigkeit", "mass": "Die Masse"}
"""What is told of a shot."""
DOUBTED: Final = {
    "first contact": "der erste Kontakt",
    "velocity": "die Geschwindigkeit",
    "mass": "die Masse",
}
"""What may be otherwise than a record has it."""
LIKE: Final = {"velocity": "", "mass": "; eine Kraft mit falschem Maßstab sähe ebenso aus"}
"""What looks the same."""
PARTS: Final = {
    "inertia": "Trägheit",
    "gravity": "Schwerkraft",
    "drive": "Antrieb",
    "a constant force": "eine konstante Kraft",
}
"""What every machine has."""
RATIOS: Final = {
    "the part's speed over the actuator's velocity":
        "die Geschwindigkeit des Teils durch die des Antriebs",
    "the impulse of force_n over mass times the part's speed and friction's impulse":
        "der Impuls von force_n durch Masse mal Geschwindigkeit des Teils und Reibungsimpuls",
    "the deceleration over gravity": "die Verzögerung durch die Schwerebeschleunigung",
}  # fmt: skip
"""What of a shot may be unlike the others."""


def _left_out(match: re.Match[str]) -> str:
    """Say why a shot is left out, and which others are; empty where no words are known."""
    why, others = match["why"], match["others"]
    if unlike := re.fullmatch(
        r"(.+) is (\S+) times that of the other shots: check its (.+) \(off by a factor of about (\S+)\)", why
    ):
        if unlike[1] not in RATIOS:
            return ""
        said = (
            f"{RATIOS[unlike[1]]} ist das {unlike[2]}-Fache dessen der anderen Stöße: "
            f"{unlike[3].replace(' or ', ' oder ')} prüfen (um etwa den Faktor {unlike[4]} daneben)"
        )
    elif pulls := re.fullmatch(r"its force_n pulls with (\S+) N, .*", why):
        said = f"force_n zieht mit {pulls[1]} N, wo ein Kontakt nur drückt: das Vorzeichen umkehren"
    elif against := re.fullmatch(r"its position_m goes (\S+) mm against the tap: .*", why):
        said = f"position_m läuft {against[1]} mm gegen den Stoß: Vorzeichen oder direction umkehren"
    elif ends := re.fullmatch(r"its record ends (\S+) ms after contact, while .* at (\S+) mm/s: .*", why):
        said = (
            f"die Aufzeichnung endet {ends[1]} ms nach dem Kontakt, während das Teil sich mit {ends[2]} mm/s "
            "bewegt: bis zur Ruhe aufzeichnen"
        )
    else:
        said = german_message(why) or ""
    more = f"; aus gleichem Grund auch {others}" if others else ""
    return f"Stoß {match['shot']} ist ausgelassen: {said}{more}." if said else ""


NOTES: Final[Patterns] = (
    (r"Shot (?P<shot>\d+) is left out: (?P<why>.+?)(?:; for the like so are (?P<others>[\d, ]+))?\.",
     _left_out),
    (r"Column (\w+) of shots\.csv is not used: .*",
     r"Spalte \1 in shots.csv bleibt weg: Der Name ist schon vergeben; die Spalte anders nennen."),
    (r"Data, .*", lambda m: german_data_fault(m[0]) or ""),
    (r"The noise of (\w+) is not stated; (\S+ \S+) was .* at rest ([^,]+), (\S+) times .* state (\w+) of .*",
     lambda m: f"Das Rauschen ({phrase(m[1])}) ist nicht angegeben; {m[2]} ist aus Messwerten in Ruhe "
     f"{AT_REST[m[3]]} geschätzt, das {m[4]}-Fache dessen, was benachbarte zeigen: es ist korreliert "
     "oder hat Ausreißer. Was sich in Ruhe bewegt, zählt als Rauschen: "
     f"{m[5]} unter sensors: {m[1]} in campaign.yaml angeben, wenn es bekannt ist."),
    (r"The noise of (\w+) is not stated; (\S+(?: \S+)?) was estimated from neigh.*",
     lambda m: f"Das Rauschen ({phrase(m[1])}) ist nicht angegeben; {m[2]} ist aus benachbarten Messwerten "
     "geschätzt, eine untere Schranke, wo es korreliert ist."),
    (r"The noise of (\w+) is stated as (\S+ \S+), and .* scatter by (\S+ [^:]+): .* check (\w+) of .*",
     lambda m: f"Das Rauschen ({phrase(m[1])}) ist mit {m[2]} angegeben, und benachbarte Messwerte streuen "
     f"um {m[3]}: Abweichungen zählen in dem, was angegeben ist, und sind damit zu groß; {m[4]} unter "
     f"sensors: {m[1]} in campaign.yaml prüfen."),
    (r"First contact lies (\S+) to (\S+) µs from t = 0, .*",
     (r"Der erste Kontakt liegt \1 bis \2 µs von t = 0, innerhalb eines Abtastschritts: "
      "er wird Stoß für Stoß angepasst.")),
    (r"First contact is fitted shot by shot and comes out (\S+) to (\S+) µs from t = 0; .*",
     (r"Der erste Kontakt wird Stoß für Stoß angepasst und kommt \1 bis \2 µs von t = 0 heraus; "
      "das kann sein, was dem Modell fehlt.")),
    ((r"(Velocity|Mass) is fitted shot by shot and comes out off what is told by (\S+ %) in the mean, "
      r"(\S+ %) from shot to shot; .*"),
     lambda m: f"{SETTINGS[m[1].lower()]} wird Stoß für Stoß angepasst und kommt im Mittel um {m[2]}, von "
     f"Stoß zu Stoß um {m[3]} neben der Angabe heraus; das kann sein, was dem Modell fehlt."),
    ((r"(Velocity|Mass) is off what is told by (\S+ %) in the mean, (\S+ %) from shot to shot"
      r"(?:, more than the (\S+ %) .*)?: it is fitted .*"),
     lambda m: f"{SETTINGS[m[1].lower()]} weicht im Mittel um {m[2]}, von Stoß zu Stoß um {m[3]} von der "
     + (f"Angabe ab, mehr als die {m[4]}, die der Messung zugeschrieben werden, " if m[4] else "Angabe ab ")
     + f"und wird Stoß für Stoß angepasst{LIKE[m[1].lower()]}."),
    ((r"Nothing would remain if (velocity|mass) were off what is told by (\S+ %) in the mean, (\S+ %) "
     r"from shot to shot, more than the (\S+ %) .*"),
     lambda m: f"{SETTINGS[m[1]]}: nichts bliebe übrig, wenn sie im Mittel um {m[2]}, von Stoß zu Stoß um "
     f"{m[3]} von der Angabe abwiche, mehr als die {m[4]}, die der Messung zugeschrieben werden: prüfen."),
    ((r"Nothing would remain if (velocity|mass) were (\S+ \S+) off in every shot, whatever is told: .*"),
     lambda m: f"{SETTINGS[m[1]]}: nichts bliebe übrig, wenn sie in jedem Stoß um {m[2]} von der Angabe "
     "abwiche, wie groß sie auch ist: ein Nullpunkt, oder was nicht mitgewogen wurde? Prüfen."),
    ((r"Nothing would remain if (velocity|mass) were off by (\S+ \S+) in the mean, (\S+) from shot to shot, "
      r"the more the larger or smaller .*"),
     lambda m: f"{SETTINGS[m[1]]}: nichts bliebe übrig, wenn sie im Mittel um {m[2]}, von Stoß zu Stoß um "
     f"{m[3]} von der Angabe abwiche, und das mit ihrer Größe: prüfen, wie sie angegeben wurde."),
    ((r"Nothing would remain if (first contact|velocity|mass) .*, but so it goes with (.+?) "
      r"\(correlation (\S+)\), .*"),
     lambda m: f"Nichts bliebe übrig, wenn {DOUBTED[m[1]]} Stoß für Stoß anders wäre als angegeben; doch so "
     f"hängt das mit der Größe „{phrase(m[2])}“ zusammen (Korrelation {m[3]}), und das tut kein Fehler einer "
     "Aufnahme."),
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
    (r"The mass of (\d+) of (\d+) slides is not stated, .* the median of the others is taken\.",
     r"Die Masse ist bei \1 von \2 Messungen nicht angegeben: Es gilt der Median der anderen."),
    (r"The mass of \d+ of \d+ slides is not stated, .* for a part of 1 kg; .*",
     ("Die Masse ist nicht angegeben, und freies Gleiten zeigt sie nicht: Kräfte, wie die viskoser Reibung, "
      "gelten für ein Teil von 1 kg; mass_kg angeben.")),
    (r"The mass of (\d+) shots is not stated and is fitted\.",
     r"Die Masse ist nicht angegeben und wird angepasst (Stöße: \1)."),
    (r"No replicates: .*",
     "Keine Wiederholungen: das Rauschen ist nur eine untere Schranke, Abweichung (b) gibt es nicht."),
    (r"Shot (\d+) has a gap in time; .*",
     r"Stoß \1 hat eine Lücke in der Zeit; was darin geschah, ist verloren."),
    (r"Samples before contact \(pretrigger\) of (\d+) shots are left out of the fits\.",
     r"Messwerte vor dem Kontakt (Stöße: \1) werden nicht angepasst."),
    (r"Outliers of (\d+) shots are left out of the fits\.", r"Ausreißer werden nicht angepasst (Stöße: \1)."),
    (r"Clipped samples of (\d+) shots are left out of the fits\.",
     r"Begrenzte Messwerte werden nicht angepasst (Stöße: \1)."),
    (r"Clipped samples of (\d+) of (\d+) records are left out: .*",
     (r"Begrenzte Messwerte sind in \1 von \2 Messungen ausgelassen: Was in ihnen oder nahe bei ihnen liegt, "
      r"zählt nicht, und Simulationen des Zurückgehaltenen beginnen nach ihnen neu.")),
    (r"In (\d+) of (\d+) records the force stands at an end of its range for more than (\d+) % of .*",
     (r"In \1 von \2 Messungen steht die Kraft mehr als \3 % der Zeit an einem Ende ihres Bereichs: Sie gilt "
      r"als das, was antreibt, wie bei einem Regler an seiner Grenze. Endet dort der Messbereich, einen "
      r"weiteren wählen.")),
    (r"The base model's (\w+) goes for all records; .* for (\d+) of (\d+) shots, .* (\d+) \((\S+)\): .*",
     lambda m: f"{m[1]} des Grundmodells gilt für alle Messungen; shots.csv gibt für {m[2]} von {m[3]} "
     f"etwas anderes an, zuerst für Messung {m[4]} ({m[5].replace('.', ',')}): {m[1]} im Grundmodell "
     "weglassen, dann hat jede ihren eigenen Wert."),
    (r"(\d+) of (\d+) samples stood far from their neighbours and were replaced\.",
     r"\1 von \2 Messwerten lagen weit von ihren Nachbarn und wurden ersetzt."),
    (r"Shot (\d+): what lies before (\S+) s is left out, since the swing grows until then: .*",
     (r"Messung \1: Was vor \2 s liegt, ist ausgelassen, denn bis dahin wächst die Schwingung: Etwas treibt "
      r"sie.")),
    (r"The column '(.+)' of shots\.csv is empty in (\d+) of (\d+) shots: nothing is judged by it\.",
     r"Die Spalte '\1' von shots.csv ist in \2 von \3 Messungen leer: Nach ihr wird nichts beurteilt."),
    (r"The force is held from one update to the next in (\d+) of (\d+) records: .*",
     (r"Die Kraft wird in \1 von \2 Messungen von einem Wert zum nächsten gehalten: Sie gilt als Vorgabe "
      r"ohne Rauschen außer einem angegebenen, die von ihrem Messwert bis zum nächsten wirkt.")),
    (r"The intervals of what is named do not include what remains: .*",
     "Die Intervalle des Benannten schließen nicht ein, was bleibt: Die Werte können außerhalb liegen."),
    (r"The position was summed up from a speed in (\d+) of (\d+) records, .* state (\w+) in .*",
     (r"Die Position ist in \1 von \2 Messungen aus einer Geschwindigkeit summiert, und deren Rauschen mit: "
      r"Es ist aus benachbarten Werten der Geschwindigkeit abgelesen und gilt als weiß. War sie gefiltert "
      r"oder aus den Schritten eines Encoders gebildet, ist es das nicht: \3 in campaign.yaml angeben oder "
      r"die Position selbst aufzeichnen.")),
    (r"(An?\w* .+) would explain (\d+) % of what remains: (.+) finds it with everything else\.",
     lambda m: f"{said} erklärte {m[2]} % dessen, was bleibt: {key_of(m[3])} zeigt es mit allem "
     "anderen."
     if (said := as_title(held_number(m[1]))) else ""),
    (r"A constant force of its own in each record would take (\d+) % of what remains: .*",
     (r"Eine eigene konstante Kraft in jeder Messung erklärte \1 % dessen, was bleibt: force_offset: {std: "
      r"free, each: record} unter den nuisances des Grundmodells lässt sie offen.")),
    (r"Each record has a constant force of its own, .*",
     ("Jede Messung hat ihre eigene konstante Kraft, auch die zurückgehaltenen: Abweichungen und Simulation "
      "sind von dem, was sie übrig lässt, mit dem Genannten und ohne es.")),
    (r"The angle jumps by a whole turn in (\d+) of (\d+) records: .*",
     (r"Der Winkel springt in \1 von \2 Messungen um eine ganze Umdrehung: Sein Geber beginnt nach jeder von "
      r"vorn, und der Winkel wurde fortgeführt.")),
    (r"There are ([\d.]+) samples in a period of the fastest motion: .*, (\d+) samples for one\.",
     (r"Auf eine Periode der schnellsten Bewegung kommen \1 Messwerte: Zwischen ihnen gilt sie als Summe von "
      r"Sinuswellen unter der halben Abtastrate, \2 Werte für einen.")),
    (r"Nothing drives: (\w+) cannot be seen and is held at its stated value\.",
     r"Nichts treibt an: \1 ist nicht zu sehen und bleibt bei dem angegebenen Wert."),
    (r"A free motion shows accelerations only: .*",
     ("Eine freie Bewegung zeigt nur Beschleunigungen: Die Trägheit bleibt bei dem angegebenen Wert, und "
      "jede Kraft zählt in Einheiten, die mit ihr gehen.")),
    (r"Inertia, gravity and gain of the force are all free: .*",
     ("Trägheit, Schwerkraft und Verstärkung der Kraft sind alle frei: Die Trägheit bleibt fest, als Einheit "
      "von allem.")),
    (r"(.+): on these records like (.+), and so not looked for\.",
     lambda m: f"{_terms(m[1])}: auf diesen Messungen wie {_parts(m[2])}, darum nicht gesucht."),
    ((r"(.+): held-out blocks want it, but simulated open loop, held-out records are (\S+ .+?) off with it, "
      r"(\S+) without; it is not named\."),
     lambda m: f"{_terms(m[1])}: Zurückgehaltene Blöcke wollen es, aber ohne Rückführung simuliert liegen "
     f"zurückgehaltene Messungen mit ihm um {m[2]} daneben, ohne um {m[3]}; es wird nicht genannt."),
    ((r"(.+): held-out blocks want it, but simulated open loop, held-out records are (\S+ .+?) off with it, "
      r"a constant (\S+); it is not named\."),
     lambda m: f"{_terms(m[1])}: Zurückgehaltene Blöcke wollen es, aber ohne Rückführung simuliert liegen "
     f"zurückgehaltene Messungen mit ihm um {m[2]} daneben, eine Konstante um {m[3]}; es wird nicht "
     "genannt."),
    (r"Records follow the base model with (.+): see which it is, and correct that\.",
     lambda m: f"Mit {column_slip(m[1])} folgen die Messungen dem Grundmodell: nachsehen, was davon "
     "zutrifft, und es berichtigen."),
    (r"A period of (\S+) rad is a turn in degrees: see whether angle_rad is in degrees\.",
     r"Eine Periode von \1 rad ist eine Umdrehung in Grad: nachsehen, ob angle_rad in Grad ist."),
    (r"(.+?) shows only beside (.+), which hides it on these records; .*",
     lambda m: f"{term_name(m[1])} zeigt sich nur neben „{term_name(m[2])}“, das es auf diesen Messungen "
     f"verdeckt; „{term_name(m[2])}“ wird nicht genannt."),
    (r"Where gravity acts, (\w+) is free in the base model; wider angles tell it from (.+)\.",
     lambda m: f"Wo die Schwerkraft wirkt, ist {m[1]} im Grundmodell frei; größere Winkel unterscheiden sie "
     f"von „{_terms(m[2])}“."),
    (r"Every record turns on one way, through (\S+) turns at most: .*",
     (r"Jede Messung dreht nur in eine Richtung, durch bis zu \1 Umdrehungen: Was sich über sie ändert, ist "
      "auch eine Funktion der Zeit; nach einem Gesetz des Ortes wird nicht gesucht, nur nach Wellen, die "
      "sich mit jeder Umdrehung wiederholen.")),
    (r"Every record goes one way: a function of position is one of the time .*",
     ("Jede Messung geht nur in eine Richtung: Eine Funktion des Ortes ist auch eine der Zeit seit ihrem "
      "Beginn, und diese Messungen unterscheiden sie kaum.")),
    (r"Nothing pulls back here, and the smallest constant force adds up: .*",
     ("Hier zieht nichts zurück, und die kleinste konstante Kraft summiert sich auf: In der Simulation hat "
      "jede zurückgehaltene Messung eine eigene, mit dem Genannten und ohne es.")),
    (r"(An?\w* .+) explains nearly all that any function .* left beside it, and has (.+)\.",
     lambda m: f"{said} erklärt fast alles, was eine Funktion von Geschwindigkeit, Last oder Ort erklärte; "
     f"das Gesetz gilt dem, was daneben bleibt, und hat {key_of(m[2])}."
     if (said := as_title(held_number(m[1]))) else ""),
    ((r"(.+): blocks do not show it, but simulated open loop, held-out records are (\S+ .+?) off with it, "
      r"(\S+) without: put (\S+) in the base model and compare\. .+ is stated \((\w+)\), would .*"),
     lambda m: f"{_any_of(m[1])}: Blöcke zeigen es nicht, aber ohne Rückführung simuliert liegen "
     f"zurückgehaltene Messungen mit ihm um {m[2]} daneben, ohne um {m[3]}: {m[4]} in das Grundmodell setzen "
     "und vergleichen. Längere Messungen, ein feinerer oder schnellerer Sensor oder sein Rauschen, wo das "
     f"angegeben ist ({m[5]}), würden es in Blöcken zeigen."),
    ((r"(.+): the gap is at its floor, yet(?: beside (.+))? over all blocks the strength of (.+) would be "
      r"(\S+) \((\S+) to (\S+), SI\), clear of 0 .* are (\S+ .+?) off with it, (\S+) without\. .*: put (\S+) "
      r"in .*"),
     lambda m: f"{_any_of(m[1])}: Die Abweichung ist an ihrer Grenze, "
     f"{f'neben „{_terms(m[2])}“' if m[2] else 'doch'} wäre über alle Blöcke die Stärke ({_any_of(m[3])}) "
     f"{m[4]} ({m[5]} bis {m[6]}, SI), von 0 verschieden und nicht durch Zufall, und ohne Rückführung "
     f"simuliert liegen zurückgehaltene Messungen mit ihm um {m[7]} daneben, ohne um {m[8]}. In der "
     f"Bewegungsgleichung verdeckt es das Rauschen, und es ist nicht benannt: {m[9]} in das Grundmodell "
     "setzen und vergleichen; längere Messungen, ein feinerer oder schnellerer Sensor oder eine größere "
     "Bewegung würden es zeigen."),
    (r"The intervals of what is named are those without it: with it, values may lie beyond them\.",
     "Die Intervalle des Benannten gelten ohne das: Mit ihm können Werte außerhalb von ihnen liegen."),
    (r"What is held out, the last third of each record, is nearly at rest: it moves (\S+) times .*",
     (r"Zurückgehalten wird das letzte Drittel jeder Messung, und das ist fast in Ruhe: Es bewegt sich "
      r"\1-mal so weit wie die ganze Messung. Ganze Messungen zurückhalten (--test) oder die Messungen "
      "früher enden lassen.")),
    (r"delay_s comes to rest at (\S+ s), the end of what the base model allows: .*",
     (r"delay_s bleibt bei \1 stehen, am Ende dessen, was das Grundmodell zulässt: Zu prüfen ist, ob Kraft "
      "und Position eine Uhr haben; sonst delay_s ein größeres std geben.")),
    ((r"Simulated open loop, the model follows held-out records to (\S+ \w+), and neighbouring samples "
      r"differ by a noise of (\S+): .* state (\w+) in .*"),
     (r"Ohne Rückführung simuliert folgt das Modell zurückgehaltenen Messungen auf \1, und benachbarte "
      r"Messwerte rauschen um \2: Rauschen, das von Messwert zu Messwert anhält, oder eine Kamera oder ein "
      r"Nullpunkt, der wandert, lässt ebenso viel übrig. Das Teil eine Weile in Ruhe aufzeichnen. Scheint es "
      r"sich auch da zu bewegen, \3 in campaign.yaml angeben: die Standardabweichung in Ruhe mal "
      r"sqrt((1 + r) / (1 - r)), r die Korrelation eines Messwerts mit dem nächsten.")),
    (r"Simulated open loop, held-out records are (\S+ .+?) off with it, (\S+) without\.",
     r"Ohne Rückführung simuliert liegen zurückgehaltene Messungen mit ihm um \1 daneben, ohne um \2."),
)  # fmt: skip
"""Notes of campaigns, of noise floors and of machines."""


def note(english: str) -> tuple[str, str]:
    """Say a note on the data: in which language, and the note."""
    return marked(english, translated(english, NOTES))


def _terms(names: str) -> str:
    return ", ".join(term_name(identifier_of(name)) for name in names.split(", "))


def _any_of(names: str) -> str:
    """Name terms of which one is enough."""
    return enumerated_names([*map(_terms, re.split(", | or ", names))], "oder")


def _parts(english: str) -> str:
    """Name parts of a machine in a row."""
    for part, german in (PARTS | {" or ": " oder "}).items():
        english = english.replace(part, german)
    return english
