"""An event as it is reported to those who listen (Part 3, 4.6; Part 4, 7.20)."""

from collections.abc import Mapping
from dataclasses import dataclass

from asyncua import ua

BrowsePath = tuple[str, ...]
"""Names from the event type to a field, as `("ActiveState", "Id")`; the empty path is the ConditionId."""


@dataclass(frozen=True, slots=True)
class EventNotification:
    """An event as it happened.

    Attributes
    ----------
    event_type : NodeId
    fields : mapping
        Browse path below the type, names only, to value.
    notifiers : frozenset of NodeId
        Nodes that report it.
    unfiltered : bool
        True for the events around a refresh, which pass every filter.
    """

    event_type: ua.NodeId
    fields: Mapping[BrowsePath, ua.Variant]
    notifiers: frozenset[ua.NodeId]
    unfiltered: bool = False
