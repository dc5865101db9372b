"""Why a module does not answer, in German: what is said of a link, and of who answers."""

import re
from collections.abc import Callable, Mapping
from typing import Final

from impactcell.german.patterns import behind_names, by_patterns
from impactcell.german.system_errors import german_system_error

REQUESTS: Final = {
    r"1 holding register from (\d+), after a write of (\d+) from (\d+)":
        r"die Anfrage nach Register \1 nach dem Schreiben von \2 ab \3",
    r"(\d+) holding registers from (\d+), after a write of (\d+) from (\d+)":
        r"die Anfrage nach \1 Registern ab \2 nach dem Schreiben von \3 ab \4",
    r"1 (?:holding|input) register from (\d+)": r"die Anfrage nach Register \1",
    r"(\d+) (?:holding|input) registers from (\d+)": r"die Anfrage nach \1 Registern ab \2",
    r"1 coil from (\d+)": r"die Anfrage nach Coil \1",
    r"(\d+) coils from (\d+)": r"die Anfrage nach \1 Coils ab \2",
    r"1 discrete input from (\d+)": r"die Anfrage nach Diskreteingang \1",
    r"(\d+) discrete inputs from (\d+)": r"die Anfrage nach \1 Diskreteingängen ab \2",
    r"a write of 1 register from (\d+)": r"das Schreiben von Register \1",
    r"a write of (\d+) registers from (\d+)": r"das Schreiben von \1 Registern ab \2",
    r"a write of 1 coil from (\d+)": r"das Schreiben von Coil \1",
    r"a write of (\d+) coils from (\d+)": r"das Schreiben von \1 Coils ab \2",
    r"a change of bits of register (\d+)": r"das Ändern von Bits des Registers \1",
    "the device identification": "die Anfrage nach der Gerätekennung",
}  # fmt: skip
"""What was asked, as patterns."""
EXCEPTIONS: Final = {
    "illegal function": "diese Funktion gibt es dort nicht",
    "illegal data address": "diese Adresse gibt es dort nicht",
    "illegal data value": "dieser Wert ist dort nicht erlaubt",
    "server device failure": "Fehler im Gerät",
    "acknowledge": "angenommen, noch in Arbeit",
    "server device busy": "das Gerät ist beschäftigt",
    "memory parity error": "Paritätsfehler im Speicher",
    "gateway path unavailable": "das Gateway hat keinen Weg dorthin",
    "gateway target device failed to respond": "das Gerät hinter dem Gateway antwortet nicht",
    "unknown exception": "unbekannte Ausnahme",
}
"""Exceptions of Modbus, by what the client calls them."""
ANY: Final = "|".join(REQUESTS)
"""Any request, as a pattern; its groups do not count."""
_REQUEST: Final = "(?P<request>" + re.sub(r"\((?!\?)", "(?:", ANY) + ")"
_TIME: Final = r"\S+ (?:s|ms \(timeout_ms\))"
_REFUSED: Final = _REQUEST + r" refused: (?P<exception>.+) \(exception (?P<code>\d+)\)"
_REFUSED_GERMAN: Final = r"\g<request> wird abgelehnt: \g<exception> (Ausnahme \g<code>)"
_IF_GAPS: Final = (
    r"; if the module refuses addresses between its registers, say `gaps: false` in map (?P<map>\S+?)"
)
_IF_GAPS_GERMAN: Final = (
    r"; falls das Modul Adressen zwischen seinen Registern ablehnt, in der Karte \g<map> "
    "`gaps: false` angeben"
)
GERMAN: Final = {
    rf"no connection within ({_TIME})": r"keine Verbindung innerhalb von \1",
    r"no connection: nothing listens at this host and port":
        "keine Verbindung: unter dieser Adresse und diesem Port antwortet kein Programm",
    r"no connection: a host's name has 1 to 63 characters between its dots":
        "keine Verbindung: ein Rechnername hat zwischen seinen Punkten je 1 bis 63 Zeichen",
    r"no connection: (?P<system>.+)": r"keine Verbindung: \g<system>",
    r"connection lost": "Verbindung verloren",
    r"connection lost: (?P<system>.+)": r"Verbindung verloren: \g<system>",
    r"connection closed": "Verbindung geschlossen",
    r"not connected": "nicht verbunden",
    r"not connected yet \(starting\)": "noch nicht verbunden (startet)",
    r"the connection was lost while several requests were in flight":
        "die Verbindung ging verloren, während mehrere Anfragen unterwegs waren",
    rf"no answer to {_REQUEST} within (?P<time>{_TIME})(?:, of \d+ in flight \(window \d+\))?":
        r"keine Antwort auf \g<request> innerhalb von \g<time>",
    _REFUSED: _REFUSED_GERMAN,
    _REFUSED + _IF_GAPS: _REFUSED_GERMAN + _IF_GAPS_GERMAN,
    _REFUSED + _IF_GAPS + r"; this is not a module of map \S+, or device_id (?P<device>\d+) is wrong":
        _REFUSED_GERMAN + _IF_GAPS_GERMAN + r"; oder das ist kein Modul dieser Karte, oder device_id "
        r"\g<device> ist falsch",
    _REFUSED + r"; this is not a module of map (?P<map>\S+), or device_id (?P<device>\d+) is wrong":
        _REFUSED_GERMAN + r"; das ist kein Modul der Karte \g<map>, oder device_id \g<device> ist falsch",
    rf"{_REQUEST}: answered with function (?P<other>\d+) instead of (?P<own>\d+)":
        r"\g<request> wird mit Funktion \g<other> statt \g<own> beantwortet",
    rf"{_REQUEST}: answered with (?P<other>\d+) bytes instead of more":
        r"\g<request> wird mit nur \g<other> Bytes beantwortet",
    rf"{_REQUEST}: answered with (?P<other>\d+) bytes instead of (?P<own>\d+)":
        r"\g<request> wird mit \g<other> Bytes statt \g<own> beantwortet",
    rf"{_REQUEST}: the answer is for another request": r"die Antwort auf \g<request> gehört zu einer anderen",
    rf"{_REQUEST}: longer than a reply can be": r"die Antwort auf \g<request> ist länger als erlaubt",
    rf"{_REQUEST}: the CRC of the answer does not fit":
        r"die Prüfsumme der Antwort auf \g<request> stimmt nicht",
    rf"{_REQUEST}: no answer in what came": r"was kam, ist keine Antwort auf \g<request>",
    rf"an answer from device (?P<device>\d+) to {_REQUEST}":
        r"auf \g<request> antwortet Gerät \g<device>",
    r"an answer to transaction (\d+), which is not open":
        r"eine Antwort auf Transaktion \1, nach der niemand gefragt hat",
    r"more bytes than were asked for": "es kommen mehr Bytes als gefragt",
    r"a datagram of (\d+) bytes, which is no whole frame":
        r"ein Datagramm von \1 Bytes, das kein ganzes Telegramm ist",
    r"not a Modbus TCP frame: protocol (\d+), length (\d+) \((\d+)\.\.(\d+)\); something other than "
    r"Modbus TCP may listen there":
        r"kein Telegramm von Modbus TCP: Protokoll \1, Länge \2 (\3 bis \4); dort antwortet vielleicht etwas "
        "anderes als Modbus TCP",
    r"(\w+) answers there, not Modbus TCP": r"dort antwortet \1, nicht Modbus TCP",
    r"the line does not become silent; does another master speak on it\?":
        "auf der Leitung wird es nicht still; spricht dort ein zweiter Master?",
    r"(\d+) readings of the status block do not fit its CRC":
        r"\1 Lesungen des Statusblocks passen nicht zu seiner Prüfsumme",
    r"(\d+) readings of the status block all differ": r"\1 Lesungen des Statusblocks sind alle verschieden",
    r"(\d+) registers from (\d+) change faster than they can be read":
        r"\1 Register ab \2 ändern sich schneller, als sie gelesen werden können",
    r"TLS files (.+?) cannot be used: (?P<system>.+)":
        r"die TLS-Dateien \1 sind nicht verwendbar: \g<system>",
    r"register (\S+) \((\d+)\) shows (.+), map (\S+) expects (.+)":
        r"Register \1 (\2) zeigt \3, die Karte \4 erwartet \5",
    r"(?P<shown>(?:[^:]|:(?! ))+): the word order is wrong, with `word_order: (?P<order>\w+)` all of it can "
    r"be":
        r"\g<shown>: die Wortreihenfolge ist falsch, mit `word_order: \g<order>` ist alles möglich",
    rf"{_REQUEST}: (?P<why>.+)": r"\g<request>: \g<why>",
}  # fmt: skip
"""What is said of a link, as patterns; what is in none of them stays English."""
SHOWN: Final = {
    r"status_crc32 does not fit": "status_crc32 passt nicht",
    r"cycle_counter shows (\S+) and ring_cycle (\[.*\])": r"cycle_counter zeigt \1 und ring_cycle \2",
    r"(\S+) shows (.+)": r"\1 zeigt \2",
}
"""What speaks against an order of words, part by part."""


def german_link_fault(reason: str) -> str:
    """Say in German why a module does not answer; cell, address and device before it stay as they are.

    >>> german_link_fault("press-1: 10.0.0.9:502 device 1: no connection within 2.5 ms (timeout_ms)")
    'press-1: 10.0.0.9:502 Gerät 1: keine Verbindung innerhalb von 2,5 ms (timeout_ms)'
    >>> german_link_fault("p: 2 holding registers from 100 refused: illegal data address (exception 2)")
    'p: die Anfrage nach 2 Registern ab 100 wird abgelehnt: diese Adresse gibt es dort nicht (Ausnahme 2)'
    """
    found = behind_names(reason, GERMAN, _WORDS)
    if found is None:
        return reason
    names, german = found
    before = [re.sub(r" device (\d+)$", r" Gerät \1", name) for name in names]
    return ": ".join([*before, re.sub(r"(?<=\d)\.(?=\d+ m?s\b)", ",", german)])


_WORDS: Final[Mapping[str, Callable[[str], str]]] = {
    "request": lambda text: by_patterns(text, REQUESTS, {}) or text,
    "exception": lambda text: EXCEPTIONS.get(text, text),
    "system": german_system_error,
    "shown": lambda text: "; ".join(by_patterns(part, SHOWN, {}) or part for part in text.split("; ")),
}
"""How what a pattern found is said, by the name of its group."""
