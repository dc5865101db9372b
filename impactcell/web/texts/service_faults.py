"""Why the service did not do what a study asked of it, as the page says it."""

from typing import Final

from impactcell.web.texts.fault_pattern import FaultPattern

SERVICE_FAULTS: Final = (
    FaultPattern(
        "does not run, its journal cannot be opened; its alarm JournalFault says why",
        "does not run, its journal cannot be opened; its alarm “Journal fault” says why",
        "läuft nicht, ihr Journal lässt sich nicht öffnen; ihr Alarm „Journal gestört“ sagt, warum",
    ),
    FaultPattern(
        r"its model stays, no program can be started on this machine \((?P<system>.+)\); end others, and try "
        "again",
        "its model stays, no program can be started on this machine ({system}); end others, and try again",
        "ihr Modell bleibt, auf diesem Rechner lässt sich kein Programm starten ({system}); andere beenden "
        "und noch einmal versuchen",
    ),
    FaultPattern("it took too long", "it took too long", "es hat zu lange gedauert"),
    FaultPattern(
        "the service was restarted meanwhile",
        "the service was restarted meanwhile",
        "der Dienst wurde inzwischen neu gestartet",
    ),
    FaultPattern(
        "a fault of this program; its log has it",
        "a fault of this program; its log has it",
        "ein Fehler dieses Programms; sein Log enthält ihn",
    ),
)
