"""OPC UA for SCADA: node table, server, conditions, access control and history.

`Server` is imported on first use, because asyncua takes more than a second to import.
"""

from typing import TYPE_CHECKING

from impactcell.opcua.host_interface import (
    Actor,
    HistoryRequest,
    Permission,
    RefusedError,
    Role,
    SecurityPolicy,
    ServerLimits,
    ServerSettings,
)
from impactcell.records.quantity import Ranges
from impactcell.scada.interface import (
    Actions,
    AlarmPage,
    CellDescription,
    ConditionAction,
    HistorySource,
    HistoryValue,
    Machine,
    ValuePage,
    default_application_uri,
)

if TYPE_CHECKING:
    from impactcell.scada.server import Server

__all__ = [
    "Actions",
    "Actor",
    "AlarmPage",
    "CellDescription",
    "ConditionAction",
    "HistoryRequest",
    "HistorySource",
    "HistoryValue",
    "Machine",
    "Permission",
    "Ranges",
    "RefusedError",
    "Role",
    "SecurityPolicy",
    "Server",
    "ServerLimits",
    "ServerSettings",
    "ValuePage",
    "default_application_uri",
]


def __getattr__(name: str) -> object:
    if name == "Server":
        from impactcell.scada.server import Server

        return Server
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
