"""Why a module does not answer, in German: what the transports say of a link."""

import re
from typing import Final

GERMAN: Final = {
    r"no connection within (\S+) s": r"keine Verbindung innerhalb von \1 s",
    r"no connection: nothing listens at this host and port":
        "keine Verbindung: unter dieser Adresse und diesem Port antwortet kein Programm",
    r"no connection: (.+)": r"keine Verbindung: \1",
    r"connection lost": "Verbindung verloren",
    r"connection lost: (.+)": r"Verbindung verloren: \1",
    r"connection closed": "Verbindung geschlossen",
    r"not connected": "nicht verbunden",
    r"no answer to (\d+) (.+) from (\d+) within (\S+) s(, of (\d+) in flight \(window \d+\))?":
        r"keine Antwort auf die Anfrage nach \1 Registern ab \3 innerhalb von \4 s",
    r"register (\S+) \((\d+)\) shows (.+), map (\S+) expects (.+)":
        r"Register \1 (\2) zeigt \3, die Karte \4 erwartet \5",
}  # fmt: skip
"""What is said of a link, as patterns; what is in none of them stays English."""


def german_link_fault(reason: str) -> str:
    """Say in German why a module does not answer; cell, address and device before it stay as they are.

    >>> german_link_fault("press-1: 10.0.0.9:502 device 1: no connection within 0.5 s")
    'press-1: 10.0.0.9:502 Gerät 1: keine Verbindung innerhalb von 0,5 s'
    """
    parts = reason.split(": ")
    for first in range(len(parts)):
        said = ": ".join(parts[first:])
        for pattern, german in GERMAN.items():
            match = re.fullmatch(pattern, said)
            if match is None:
                continue
            before = [re.sub(r" device (\d+)$", r" Gerät \1", part) for part in parts[:first]]
            return ": ".join([*before, re.sub(r"(?<=\d)\.(?=\d+ s)", ",", match.expand(german))])
    return reason
