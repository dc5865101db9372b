"""OPC UA for SCADA: node table, server, conditions, access control and history.

`Server` is imported on first use, because asyncua takes more than a second to import.
"""

from typing import TYPE_CHECKING

from impactcell.scada.interface import (
    Actions,
    Actor,
    AlarmPage,
    CellDescription,
    HistorySource,
    HistoryValue,
    Limits,
    Machine,
    Ranges,
    RefusedError,
    Role,
    SecurityPolicy,
    ServerSettings,
    ValuePage,
)

if TYPE_CHECKING:
    from impactcell.scada.server import Server

__all__ = [
    "Actions",
    "Actor",
    "AlarmPage",
    "CellDescription",
    "HistorySource",
    "HistoryValue",
    "Limits",
    "Machine",
    "Ranges",
    "RefusedError",
    "Role",
    "SecurityPolicy",
    "Server",
    "ServerSettings",
    "ValuePage",
]


def __getattr__(name: str) -> object:
    if name == "Server":
        from impactcell.scada.server import Server

        return Server
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
