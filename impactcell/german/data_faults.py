"""What is wrong with recorded data, in German: `impactcell.quality` says it for reports and the page."""

import re
from collections.abc import Callable, Sequence
from typing import Final

KINDS: Final = {
    "outliers": "Ausreißer",
    "clipping": "Begrenzung",
    "dropouts": "Aussetzer",
    "drift": "Drift",
    "late channel": "verspäteter Kanal",
    "constant channel": "konstanter Kanal",
    "no motion": "keine Bewegung",
    "presliding only": "nur Vorgleiten",
    "copy": "Kopie",
}
"""Kinds of what is wrong with data."""
CHANNELS: Final = {"force": "Kraft", "position": "Position", "actuator": "Antrieb"}
"""Channels of a shot."""
ENDS: Final = {"upper": "oberen", "lower": "unteren"}
"""Ends of a channel's range."""
MESSAGES: Final[Sequence[tuple[str, str | Callable[[re.Match[str]], str]]]] = (
    (r"the (\w+) is constant at (\S+): .*",
     lambda m: f"{CHANNELS[m[1]]} steht konstant auf {m[2]}: nicht angeschlossen, oder die falsche Spalte"),
    (r"(\d+) outliers in the (\w+), the first at (\S+) s \((\S+) amid (\S+)\): .*",
     lambda m: f"Ausreißer ({CHANNELS[m[2]]}): {m[1]}, der erste bei {m[3]} s ({m[4]} inmitten von {m[5]}): "
     "Kabel und Schirmung prüfen"),
    (r"the (\w+) stands at its (\w+) end, (\S+), for (\d+) samples from (\S+) s \((\d+) in all\): .*",
     lambda m: f"{CHANNELS[m[1]]} steht {m[4]} Messwerte lang am {ENDS[m[2]]} Ende, {m[3]}, ab {m[5]} s "
     f"({m[6]} insgesamt): abgeschnitten; einen weiteren Messbereich wählen"),
    (r"the (\w+) is stuck at (\S+) for (\d+) samples from (\S+) s \((\d+) such stretches\): .*",
     lambda m: f"{CHANNELS[m[1]]} bleibt {m[3]} Messwerte lang auf {m[2]} stehen, ab {m[4]} s (so an {m[5]} "
     "Stellen): Messwerte gingen verloren"),
    (r"samples of the (\w+) are missing in (\d+)(?: places?)?, the first for (\S+) ms from (\S+) s: .*",
     lambda m: f"{CHANNELS[m[1]]}: Messwerte fehlen an {m[2]} Stelle{'n' * (m[2] != '1')}, zuerst {m[3]} ms "
     f"lang ab {m[4]} s: was dabei geschah, ist verloren"),
    (r"the part does not move: its position stays within (\S+) (m|rad), noise is (\S+) (?:m|rad)",
     r"das Teil bewegt sich nicht: seine Position bleibt innerhalb von \1 \2, das Rauschen ist \3 \2"),
    (r"its position follows the force as on a spring: .*",
     ("seine Position folgt der Kraft wie an einer Feder: es gleitet nie, oder eine Feder oder sein Gewicht "
      "überwiegt die Reibung bei weitem; stärker antreiben")),
    (r"the part never slides: it moves by (\S+) (m|rad) and springs back, .*",
     r"das Teil gleitet nie: es bewegt sich um \1 \2 und federt zurück (Vorgleiten); stärker stoßen"),
    (r"the (\w+) is recorded (\S+) ms after the (\w+) \((\d+) shots\): .*",
     lambda m: f"{CHANNELS[m[1]]} ist {m[2]} ms später aufgezeichnet als {CHANNELS[m[3]]} ({m[4]} Stöße): "
     "Filter und Uhr dieses Kanals prüfen, bevor ein Gesetz schuld ist (impactcell import --delay verschiebt "
     "ihn)"),
    (r"its samples are those of shot (\d+), .*",
     (r"seine Messwerte sind die von Stoß \1, samt Rauschen: eine Aufzeichnung zählt doppelt; eine davon "
      "weglassen, oder dem Stoß seine eigenen geben")),
    (r"the force at rest goes from (\S+) N to (\S+) N over (\d+) shots: .*",
     r"die Kraft in Ruhe geht von \1 N auf \2 N über \3 Stöße: Sensor tarieren, warm werden lassen"),
    (r"the force at rest is another one in each shot, by (\S+) N, (\S+) times its noise: .*",
     (r"die Kraft in Ruhe ist in jedem Stoß eine andere, um \1 N, das \2-fache ihres Rauschens: ihr "
      "Nullpunkt wandert, es sei denn, das Teil berührt da noch den Antrieb; vor jedem Stoß tarieren, den "
      "Verstärker ansehen, oder auch vor dem Kontakt aufzeichnen: davon nimmt `impactcell import` den "
      "Nullpunkt")),
)  # fmt: skip
"""What is said of a shot: English as a pattern, and German as that is expanded."""
NOTE: Final = re.compile(
    r"Data, (?P<kind>[^:]+): (?:shot (?P<shot>\d+): )?(?P<message>.*?)"
    r"(?:; the like in (?P<others>\d+) more shots)?\.",
    re.DOTALL,
)
"""A note on the data, as `impactcell.quality.notes_of` writes it."""


def german_data_fault(note: str) -> str | None:
    """Say a note on the data in German, None where no pattern knows it; decimal points stay.

    >>> german_data_fault("Data, no motion: shot 3: it sleeps.") is None
    True
    """
    match = NOTE.fullmatch(note)
    said = None if match is None else german_message(match["message"])
    if match is None or said is None:
        return None
    place = "" if match["shot"] is None else f"Stoß {match['shot']}: "
    more = "" if match["others"] is None else f"; ebenso in weiteren Stößen: {match['others']}"
    return f"Daten, {KINDS[match['kind']]}: {place}{said}{more}."


def german_message(english: str) -> str | None:
    """Say what is wrong with a shot in German, None where no pattern knows it; decimal points stay."""
    for pattern, german in MESSAGES:
        if match := re.fullmatch(pattern, english, re.DOTALL):
            return match.expand(german) if isinstance(german, str) else german(match)
    return None
