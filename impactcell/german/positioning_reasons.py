"""Why a positioning task ends, is refused or has been stopped, in German: in its alarm, and on the page."""

from collections.abc import Callable, Mapping
from typing import Final

from impactcell.german.link_faults import german_link_fault
from impactcell.german.patterns import behind_names, by_patterns

NOT_COMMANDED: Final = "; nothing has been commanded"
"""Behind what kept a tap from being commanded."""
_NOT_COMMANDED_GERMAN: Final = "; es wurde nichts befohlen"
_STRUCK: Final = "; the part may have been struck"
_STRUCK_GERMAN: Final = "; das Teil kann gestoßen worden sein"
_REMAIN: Final = r"(?P<a>\S+) µm remain, "
_REMAIN_GERMAN: Final = r"\g<a> µm fehlen, "
_PROBABLY: Final = r"with a probability above (?P<p>\S+)"
_PROBABLY_GERMAN: Final = r"mit einer Wahrscheinlichkeit über \g<p>"
GERMAN: Final = {
    # a target that is not begun
    r"a task to (?P<a>\S+) mm is running; abort it first":
        r"eine Aufgabe mit Ziel \g<a> mm läuft; sie zuerst abbrechen",
    r"the target must be a position in mm, not (\S+)": r"das Ziel muss eine Position in mm sein, nicht \1",
    r"the position of the part is not known": "die Position des Teils ist nicht bekannt",
    r"target (?P<a>\S+) mm is beyond the travel of (?P<b>\S+) to (?P<c>\S+) mm":
        r"das Ziel \g<a> mm liegt außerhalb des Verfahrwegs von \g<b> bis \g<c> mm",
    r"a tolerance of (?P<a>\S+) µm is finer than the encoder's (?P<b>\S+) µm; raise (\S+)":
        r"eine Toleranz von \g<a> µm ist feiner als die \g<b> µm des Wegmesssystems; \3 erhöhen",
    r"target (?P<a>\S+) mm lies behind the part at (?P<b>\S+) mm, and this cell strikes from one side only":
        r"das Ziel \g<a> mm liegt hinter dem Teil bei \g<b> mm, und diese Zelle stößt nur von einer Seite",
    r"the mass of the part is not known; state it in the cell file or register":
        "die Masse des Teils ist nicht bekannt; sie in der Zellendatei oder im Register angeben",
    r"friction is not known yet; let the estimator see some cycles first":
        "die Reibung ist noch nicht bekannt; zuerst einige Zyklen messen lassen",
    r"aborted, or another task was started, meanwhile":
        "inzwischen abgebrochen, oder eine andere Aufgabe wurde begonnen",
    # no tap that would do
    r"the part lies (?P<a>\S+) mm beyond its target and this cell cannot push it back":
        r"das Teil liegt \g<a> mm hinter seinem Ziel, und diese Zelle kann es nicht zurückstoßen",
    r"the target lies (?P<a>\S+) mm beyond the travel":
        r"das Ziel liegt \g<a> mm außerhalb des Verfahrwegs",
    _REMAIN + r"(\d+) taps in a row have moved nothing, and any that moves more overshoots " + _PROBABLY:
        _REMAIN_GERMAN + r"\2 Stöße nacheinander haben nichts bewegt, und jeder, der mehr bewegt, geht "
        + _PROBABLY_GERMAN + " zu weit",
    r"no tap up to (?P<a>\S+) m/s and (?P<b>\S+) mm moves a part of (?P<c>\S+) kg at friction (?P<d>\S+)":
        r"kein Stoß bis \g<a> m/s und \g<b> mm bewegt ein Teil von \g<c> kg bei einer Reibung von \g<d>",
    r"no tap within (?P<key>\S+), (?P<a>\S+) N, moves a part of (?P<b>\S+) kg at friction (?P<c>\S+); "
    r"the gentlest that does may take (?P<d>\S+) N":
        r"kein Stoß innerhalb von \g<key>, \g<a> N, bewegt ein Teil von \g<b> kg bei einer Reibung von "
        r"\g<c>; der sanfteste, der es bewegt, kann \g<d> N erreichen",
    r"a part of (?P<a>\S+) kg is too light to plan for: below (?P<b>\S+) kg the damping of the contact "
    r"keeps it from springing back":
        r"ein Teil von \g<a> kg ist zu leicht, um Stöße zu planen: unter \g<b> kg hält die Dämpfung des "
        r"Kontakts es davon ab zurückzufedern",
    r"the part cannot lie at (?P<a>\S+) m, far beyond the travel of (?P<b>\S+) to (?P<c>\S+) m; "
    r"positions are in metres":
        r"das Teil kann nicht bei \g<a> m liegen, weit außerhalb des Verfahrwegs von \g<b> bis \g<c> m; "
        r"Positionen werden in Metern angegeben",
    r"the part cannot lie at (?P<a>\S+) m; positions are in metres":
        r"das Teil kann nicht bei \g<a> m liegen; Positionen werden in Metern angegeben",
    r"the part cannot lie (?P<a>\S+) m from its target; distances are in metres":
        r"das Teil kann nicht \g<a> m von seinem Ziel liegen; Abstände werden in Metern angegeben",
    r"the part cannot lie (?P<a>\S+) m from its target; distances are in metres: if that was meant in "
    r"(?P<unit>\S+), give (?P<b>\S+)":
        r"das Teil kann nicht \g<a> m von seinem Ziel liegen; Abstände werden in Metern angegeben: waren "
        r"\g<unit> gemeint, \g<b> angeben",
    _REMAIN + r"and every tap for a part of (?P<b>\S+) kg overshoots (?P<c>\S+) µm " + _PROBABLY
    + r" \(the safest with (?P<d>\S+)\)":
        _REMAIN_GERMAN + r"und jeder Stoß auf ein Teil von \g<b> kg geht " + _PROBABLY_GERMAN
        + r" um mehr als \g<c> µm zu weit (der sicherste mit \g<d>)",
    _REMAIN + r"and every tap for a part of (?P<b>\S+) kg overshoots or may pass the end of the travel, "
    r"(?P<c>\S+) mm away; set a target further from it, or a wider tolerance":
        _REMAIN_GERMAN + r"und jeder Stoß auf ein Teil von \g<b> kg geht zu weit, oder vielleicht über das "
        r"Ende des Verfahrwegs in \g<c> mm; ein Ziel weiter weg davon oder eine größere Toleranz angeben",
    r"a tap at (?P<a>\S+) m/s is not allowed, the limit is (?P<b>\S+) m/s":
        r"ein Stoß mit \g<a> m/s ist nicht erlaubt, höchstens \g<b> m/s",
    r"a stroke of (?P<a>\S+) mm is not allowed, the limit is (?P<b>\S+) mm":
        r"ein Hub von \g<a> mm ist nicht erlaubt, höchstens \g<b> mm",
    r"a tap with up to (?P<a>\S+) N is not allowed, the limit is (?P<b>\S+) N":
        r"ein Stoß mit bis zu \g<a> N ist nicht erlaubt, höchstens \g<b> N",
    r"a tap that may bring the part to (?P<a>\S+) mm is not allowed, its travel is (?P<b>\S+) to "
    r"(?P<c>\S+) mm":
        r"ein Stoß, der das Teil bis \g<a> mm bringen kann, ist nicht erlaubt, der Verfahrweg ist \g<b> bis "
        r"\g<c> mm",
    r"(?:tap )?direction must be 1 or -1, not (\S+)": r"die Richtung muss 1 oder -1 sein, nicht \1",
    r"tap velocity must be above 0, not (?P<a>\S+) m/s":
        r"die Geschwindigkeit muss über 0 liegen, nicht \g<a> m/s",
    r"tap stroke must be above 0, not (?P<a>\S+) m": r"der Hub muss über 0 liegen, nicht \g<a> m",
    # what a module does
    r"the module does not answer, or has no positioning registers":
        "das Modul antwortet nicht, oder es hat keine Register zum Positionieren",
    r"map (\S+) has no positioning registers": r"die Karte \1 hat keine Register zum Positionieren",
    r"the map lacks registers of a positioning cell":
        "der Karte fehlen Register einer Zelle, die positioniert",
    r"module takes no command, it is (.+)": r"das Modul nimmt keinen Befehl an, es ist \1",
    r"register (\S+) \((\d+)\) does not show what was written" + NOT_COMMANDED:
        r"Register \1 (\2) zeigt nicht, was geschrieben wurde" + _NOT_COMMANDED_GERMAN,
    r"register (\S+) \((\d+)\) cannot express (?P<a>\S+), it would show (?P<b>\S+)" + NOT_COMMANDED:
        r"Register \1 (\2) kann \g<a> nicht ausdrücken, es zeigte \g<b>" + _NOT_COMMANDED_GERMAN,
    r"the part no longer lies where the tap was planned from" + NOT_COMMANDED:
        "das Teil liegt nicht mehr dort, von wo aus der Stoß geplant ist" + _NOT_COMMANDED_GERMAN,
    r"the part no longer lies where the tap was planned from" + _STRUCK:
        "das Teil liegt nicht mehr dort, von wo aus der Stoß geplant ist" + _STRUCK_GERMAN,
    r"the part has moved (\d+) times before tap (\d+) was made":
        r"das Teil hat sich \1-mal bewegt, bevor Stoß \2 ausgeführt war",
    r"tap not finished within (\S+) s" + NOT_COMMANDED:
        r"der Stoß war nach \1 s nicht beendet" + _NOT_COMMANDED_GERMAN,
    r"tap not finished within (\S+) s" + _STRUCK: r"der Stoß war nach \1 s nicht beendet" + _STRUCK_GERMAN,
    r"tap not finished within (\S+) s; the module has not taken command (\d+), "
    r"register (\S+) \((\d+)\) shows (\d+)":
        r"der Stoß war nach \1 s nicht beendet; das Modul hat den Befehl \2 nicht angenommen, "
        r"Register \3 (\4) zeigt \5",
    r"register (\S+) \((\d+)\) has changed from (\d+) to (\d+) before command (\d+) was written: "
    r"the module has taken an earlier one" + _STRUCK:
        r"Register \1 (\2) hat sich von \3 auf \4 geändert, bevor der Befehl \5 geschrieben war: "
        "das Modul hat einen früheren angenommen" + _STRUCK_GERMAN,
    r"module was started anew during tap (\d+)": r"das Modul wurde während Stoß \1 neu gestartet",
    r"tap (\d+): (.+)": r"Stoß \1: \2",
    r"the module has not been read for (\S+) s": r"das Modul ließ sich \1 s lang nicht lesen",
    r"the module has not been ready for (\S+) s, it is (.+)":
        r"das Modul war \1 s lang nicht bereit, es ist \2",
    r"the module reported no position after tap (\d+)": r"das Modul meldet nach Stoß \1 keine Position",
    r"no further tap is commanded, but the module could not be told: (?P<link>.+)":
        r"kein weiterer Stoß wird befohlen, doch dem Modul ließ es sich nicht sagen: \g<link>",
    # what became of a task
    r"tap (\d+) moved nothing": r"Stoß \1 hat nichts bewegt",
    r"tap (\d+) moved the part by (?P<a>\S+) mm, outside the 99\.9 % band of (?P<b>\S+) to (?P<c>\S+) mm":
        r"Stoß \1 hat das Teil um \g<a> mm bewegt, außerhalb des Bereichs von \g<b> bis \g<c> mm, der 99,9 % "
        "enthält",
    r"not in place after (\d+) taps": r"nach \1 Stößen nicht am Ziel",
    r"interrupted during tap (\d+); set the target again":
        r"während Stoß \1 unterbrochen; das Ziel neu setzen",
    r"in place": "am Ziel",
    r"in place; (?P<miss>.+)": r"am Ziel; \g<miss>",
    r"aborted by the PLC, which has a new target": "abgebrochen von der SPS, die ein neues Ziel hat",
    r"aborted by (.+)": r"abgebrochen von \1",
}  # fmt: skip
"""What is said of a task, as patterns, after the name of its cell; what is in none of them stays English."""


def german_positioning_reason(reason: str) -> str:
    """Say in German what became of a positioning task; the cell before it stays as it is.

    >>> german_positioning_reason("press-1: tap 3 moved nothing")
    'press-1: Stoß 3 hat nichts bewegt'
    >>> german_positioning_reason("in place")
    'am Ziel'
    """
    found = behind_names(reason, GERMAN, _WORDS)
    if found is not None:
        return ": ".join([*found[0], found[1]])
    for end, german in ((NOT_COMMANDED, _NOT_COMMANDED_GERMAN), (_STRUCK, _STRUCK_GERMAN)):
        if reason.endswith(end):
            return german_link_fault(reason.removesuffix(end)) + german
    return german_link_fault(reason)


def _number(text: str) -> str:
    return text.replace(".", ",")


_WORDS: Final[Mapping[str, Callable[[str], str]]] = {
    **dict.fromkeys("abcdp", _number),
    "link": german_link_fault,
    "miss": lambda text: by_patterns(text, GERMAN, _WORDS) or text,
}
"""How what a pattern found is said, by the name of its group: numbers, a fault of a link, another reason."""
