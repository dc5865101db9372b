"""Who may do what: the one table that the server enforces, the tests try and the documentation prints."""

import enum
from collections.abc import Mapping
from typing import Final

from impactcell.alarms import EventKind
from impactcell.opcua.host_interface import Permission, Role


class Area(enum.Enum):
    """Nodes that share their rights."""

    NODES = "every node"
    VALUES = "variables of a cell"
    EVENTS = "a cell as a source of events"
    REFRESH = "ConditionRefresh, ConditionRefresh2"
    ACKNOWLEDGE = "conditions: Acknowledge"
    CONFIRM = "conditions: Confirm"
    COMMENT = "conditions: AddComment"
    SHELVE = "conditions: TimedShelve, OneShotShelve, Unshelve"
    ENABLE = "conditions: Enable, Disable"
    START_BATCH = "StartBatch"
    ABORT_POSITIONING = "AbortPositioning"
    SET_TARGET = "SetTarget"
    RESET_WEAR = "ResetWear"


MATRIX: Final[Mapping[tuple[Area, Permission], Role | None]] = {
    (Area.NODES, Permission.BROWSE): Role.OBSERVER,
    (Area.NODES, Permission.READ): Role.OBSERVER,
    (Area.NODES, Permission.WRITE): None,
    (Area.VALUES, Permission.SUBSCRIBE): Role.OBSERVER,
    (Area.VALUES, Permission.READ_HISTORY): Role.OBSERVER,
    (Area.EVENTS, Permission.SUBSCRIBE): Role.OBSERVER,
    (Area.EVENTS, Permission.READ_HISTORY): Role.OBSERVER,
    (Area.REFRESH, Permission.CALL): Role.OBSERVER,
    (Area.ACKNOWLEDGE, Permission.CALL): Role.OPERATOR,
    (Area.CONFIRM, Permission.CALL): Role.OPERATOR,
    (Area.COMMENT, Permission.CALL): Role.OPERATOR,
    (Area.SHELVE, Permission.CALL): Role.OPERATOR,
    (Area.ENABLE, Permission.CALL): Role.ENGINEER,
    (Area.START_BATCH, Permission.CALL): Role.OPERATOR,
    (Area.ABORT_POSITIONING, Permission.CALL): Role.OPERATOR,
    (Area.SET_TARGET, Permission.CALL): Role.ENGINEER,
    (Area.RESET_WEAR, Permission.CALL): Role.ENGINEER,
}
"""Lowest role that has a right; None where nobody has it."""

CONDITION_AREAS: Final[Mapping[EventKind, Area]] = {
    EventKind.ACKNOWLEDGE: Area.ACKNOWLEDGE,
    EventKind.CONFIRM: Area.CONFIRM,
    EventKind.COMMENT: Area.COMMENT,
    EventKind.SHELVE_TIMED: Area.SHELVE,
    EventKind.SHELVE_ONE_SHOT: Area.SHELVE,
    EventKind.UNSHELVE: Area.SHELVE,
    EventKind.ENABLE: Area.ENABLE,
    EventKind.DISABLE: Area.ENABLE,
}


def allowed(role: Role, area: Area, permission: Permission) -> bool:
    """Whether a role has a right; what the table does not name is refused."""
    lowest = MATRIX.get((area, permission))
    return lowest is not None and role >= lowest


def matrix_table() -> str:
    """Print the table in Markdown.

    >>> print(matrix_table().splitlines()[0])
    | node | right | Observer | Operator | Engineer |
    """
    lines = [
        "| node | right | " + " | ".join(role.name.capitalize() for role in Role) + " |",
        "|---|---|" + "---|" * len(Role),
    ]
    for area, permission in MATRIX:
        cells = " | ".join("yes" if allowed(role, area, permission) else "-" for role in Role)
        lines.append(f"| {area.value} | {permission.value} | {cells} |")
    return "\n".join(lines)
