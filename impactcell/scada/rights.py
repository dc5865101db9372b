"""Who may do what: the one table that the server enforces, the tests try and the documentation prints."""

import enum
from collections.abc import Mapping
from typing import Final

from impactcell.alarms import EventKind
from impactcell.scada.interface import Role


class Right(enum.Enum):
    """What can be done to a node."""

    BROWSE = "browse"
    READ = "read"
    SUBSCRIBE = "subscribe"
    WRITE = "write"
    HISTORY = "read history"
    CALL = "call"


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


MATRIX: Final[Mapping[tuple[Area, Right], Role | None]] = {
    (Area.NODES, Right.BROWSE): Role.OBSERVER,
    (Area.NODES, Right.READ): Role.OBSERVER,
    (Area.NODES, Right.WRITE): None,
    (Area.VALUES, Right.SUBSCRIBE): Role.OBSERVER,
    (Area.VALUES, Right.HISTORY): Role.OBSERVER,
    (Area.EVENTS, Right.SUBSCRIBE): Role.OBSERVER,
    (Area.EVENTS, Right.HISTORY): Role.OBSERVER,
    (Area.REFRESH, Right.CALL): Role.OBSERVER,
    (Area.ACKNOWLEDGE, Right.CALL): Role.OPERATOR,
    (Area.CONFIRM, Right.CALL): Role.OPERATOR,
    (Area.COMMENT, Right.CALL): Role.OPERATOR,
    (Area.SHELVE, Right.CALL): Role.OPERATOR,
    (Area.ENABLE, Right.CALL): Role.ENGINEER,
    (Area.START_BATCH, Right.CALL): Role.OPERATOR,
    (Area.ABORT_POSITIONING, Right.CALL): Role.OPERATOR,
    (Area.SET_TARGET, Right.CALL): Role.ENGINEER,
    (Area.RESET_WEAR, Right.CALL): Role.ENGINEER,
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


def allowed(role: Role, area: Area, right: Right) -> bool:
    """Whether a role has a right; what the table does not name is refused."""
    lowest = MATRIX.get((area, right))
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
    for area, right in MATRIX:
        cells = " | ".join("yes" if allowed(role, area, right) else "-" for role in Role)
        lines.append(f"| {area.value} | {right.value} | {cells} |")
    return "\n".join(lines)
