"""Why a journal cannot be written or was begun anew, in German."""

from collections.abc import Callable, Mapping
from typing import Final

from impactcell.german.patterns import behind_names
from impactcell.german.system_errors import german_system_error

AS_IT_IS: Final = "sie bleibt, wie sie ist"
ANOTHER: Final = "eine andere Datei angeben"
IN_USE: Final = (
    "während das Journal in Gebrauch war; was es bis dahin enthielt, ist verloren, wenn es nicht "
    "zurückgelegt wird; an seiner Stelle wird ein neues begonnen"
)
WAY_OUT: Final = "die Version verwenden, die es schrieb, oder mit einer anderen Datei neu beginnen"
GERMAN: Final = {
    # it may be written again
    r"the disk or its quota is full \((?P<system>.+)\); make room":
        r"Datenträger oder Kontingent sind voll (\g<system>); Platz schaffen",
    r"cannot be used now \((?P<system>.+)\); check its disk, directory and owner":
        r"derzeit nicht verwendbar (\g<system>); Datenträger, Verzeichnis und Besitzer prüfen",
    r"another program has it open for writing \(.+\); close it there":
        r"ein anderes Programm hat es zum Schreiben geöffnet; es dort schließen",
    r"the disk failed \((?P<system>.+), (?P<code>\w+)\) though it is not full: its quota may be, or it is "
    r"broken or gone; see the system's log":
        r"der Datenträger versagt (\g<system>, \g<code>), ohne voll zu sein: sein Kontingent kann es sein, "
        r"oder er ist defekt oder nicht mehr da; das Systemlog sagt mehr",
    # it was begun anew
    r"cannot be begun anew: (?P<fault>.+)": r"kann nicht neu begonnen werden: \g<fault>",
    r"the journal is begun anew; what is damaged was put aside as (?P<name>.+)":
        r"das Journal wird neu begonnen; das beschädigte liegt daneben als \g<name>",
    r"the journal is begun anew": "das Journal wird neu begonnen",
    r"(?P<fault>.+); the state of an earlier cycle is used instead":
        r"\g<fault>; statt seiner gilt der Stand eines früheren Zyklus",
    r"(?P<fault>.+); wear, batch, signature, and what positioning has learned, begin anew":
        r"\g<fault>; Verschleiß, Charge, Vergleichskurve und was das Positionieren gelernt hat, beginnen neu",
    r"(?P<path>.+) is gone while the journal was in use; what it held up to then is lost unless it is put "
    r"back, a new one is begun in its place":
        rf"\g<path> verschwand, {IN_USE}",
    r"(?P<path>.+) was replaced by another file while the journal was in use; what it held up to then is "
    r"lost unless it is put back, a new one is begun in its place":
        rf"\g<path> wurde durch eine andere Datei ersetzt, {IN_USE}",
    # it is not as it was written
    r"the table (?P<table>\w+) is damaged: a checksum is wrong":
        r"die Tabelle \g<table> ist beschädigt: eine Prüfsumme stimmt nicht",
    r"is damaged and cannot be used \(its text is no UTF-8\)":
        "ist beschädigt und nicht verwendbar (ihr Text ist kein UTF-8)",
    r"is damaged and cannot be used \((?P<system>.+)\)": r"ist beschädigt und nicht verwendbar (\g<system>)",
    r"cannot be used \((?P<system>.+)\); name another file":
        rf"nicht verwendbar (\g<system>); {ANOTHER}",
    r"cannot be used \((?P<system>.+)\)": r"nicht verwendbar (\g<system>)",
    r"cycle (?P<cycle>\d+) is stored already": r"Zyklus \g<cycle> ist schon gespeichert",
    # it is another's
    r"not a journal \((?P<system>.+)\); it is left as it is; name another file":
        rf"kein Journal (\g<system>); {AS_IT_IS}; {ANOTHER}",
    r"not a journal, not even a database; it is left as it is; name another file":
        f"kein Journal, nicht einmal eine Datenbank; {AS_IT_IS}; {ANOTHER}",
    r"a database, but no journal of impactcell; it is left as it is; name another file":
        f"eine Datenbank, aber kein Journal von impactcell; {AS_IT_IS}; {ANOTHER}",
    r"another service writes this journal; end it first: to remove its lock does not help":
        "ein anderer Dienst schreibt dieses Journal; ihn zuerst beenden: die Sperre zu entfernen hilft nicht",
    r"another service has begun to write this journal, for its lock was removed; end one of them":
        "ein anderer Dienst schreibt dieses Journal inzwischen auch, denn seine Sperre wurde entfernt; einen "
        "der beiden beenden",
    r"the journal of cell '(?P<other>.+)', not of '(?P<own>.+)'; name another file":
        rf"das Journal der Zelle „\g<other>“, nicht von „\g<own>“; {ANOTHER}",
    r"the journal(?: of cell '(?P<cell>.+)')? has format (?P<format>\d+), this version of the program knows "
    r"(?P<least>\d+) to (?P<most>\d+); it is left as it is: run the version that wrote it, or name another "
    r"file to begin anew":
        r"das Journal hat Format \g<format>, diese Version kennt \g<least> bis \g<most>; es bleibt, wie es "
        rf"ist: {WAY_OUT}",
    r"the journal of cell '(?P<cell>.+)' is left as it is, (?P<fault>.+): run the version that wrote it, or "
    r"name another file to begin anew":
        rf"das Journal der Zelle „\g<cell>“ bleibt, wie es ist (\g<fault>): {WAY_OUT}",
    r"the state is of format (?P<format>\d+), this version knows up to (?P<most>\d+)":
        r"der Stand hat Format \g<format>, diese Version kennt bis \g<most>",
    r"the state(?: of format (?P<format>\d+))? cannot be read: (?P<why>.+)":
        r"der Stand ist nicht lesbar: \g<why>",
}  # fmt: skip
"""What is said of a journal, as patterns, after its file; what is in none of them stays English."""


def german_journal_fault(reason: str) -> str:
    """Say in German why a journal cannot be written; its file before it stays as it is.

    >>> german_journal_fault("/j.sqlite: the disk or its quota is full (database or disk is full); make room")
    '/j.sqlite: Datenträger oder Kontingent sind voll (kein Platz); Platz schaffen'
    """
    found = behind_names(reason, GERMAN, _WORDS)
    return reason if found is None else ": ".join([*found[0], found[1]])


_WORDS: Final[Mapping[str, Callable[[str], str]]] = {
    "fault": german_journal_fault,
    "system": german_system_error,
}
"""How what a pattern found is said, by the name of its group."""
