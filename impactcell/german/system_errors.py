"""What the system and SQLite say of a fault, in German: it stands within other messages."""

import re
from typing import Final

GERMAN: Final = {
    "Address already in use": "die Adresse wird schon benutzt",
    "Broken pipe": "die Gegenseite hat die Verbindung geschlossen",
    "Connection refused": "die Gegenseite nimmt keine Verbindung an",
    "Connection reset by peer": "die Gegenseite hat die Verbindung abgebrochen",
    "Connection timed out": "keine Antwort in der Zeit, die das System wartet",
    "Device or resource busy": "wird schon benutzt",
    "Disk quota exceeded": "das Kontingent ist erschöpft",
    "Host is down": "das Gerät ist nicht am Netz",
    "Input/output error": "Ein- oder Ausgabefehler",
    "Is a directory": "ist ein Verzeichnis",
    "Name or service not known": "diesen Namen kennt das Netz nicht",
    "Network is down": "das Netz ist abgeschaltet",
    "Network is unreachable": "das Netz ist nicht erreichbar",
    "No address associated with hostname": "zu diesem Namen gibt es keine Adresse",
    "No route to host": "kein Weg dorthin",
    "No space left on device": "kein Platz auf dem Datenträger",
    "No such device": "das Gerät gibt es nicht",
    "No such file or directory": "gibt es nicht",
    "Not a directory": "ist kein Verzeichnis",
    "Permission denied": "keine Berechtigung",
    "Read-only file system": "der Datenträger ist schreibgeschützt",
    "Temporary failure in name resolution": "Namen lassen sich gerade nicht auflösen",
    "attempt to write a readonly database": "die Datei ist schreibgeschützt",
    "database disk image is malformed": "ihr Inhalt ist beschädigt",
    "database is locked": "ein anderes Programm hält sie fest",
    "database or disk is full": "kein Platz",
    "disk I/O error": "Ein- oder Ausgabefehler",
    "file is not a database": "keine Datenbank",
    "unable to open database file": "die Datei lässt sich nicht öffnen",
}
"""By what is said in English; what is not here stays as it is."""


def german_system_error(text: str) -> str:
    """Say what the system said in German, without its number.

    >>> german_system_error("[Errno 104] Connection reset by peer")
    'die Gegenseite hat die Verbindung abgebrochen'
    """
    said = re.sub(r"^\[Errno -?\d+\] ", "", text)
    said, quote, file = said.partition(": '")
    return GERMAN[said] + quote + file if said in GERMAN else text
