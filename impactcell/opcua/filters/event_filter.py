"""Event filters (Part 4, 7.22.3): which events a client wants, and which of their fields."""

from typing import Any, Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.event_notification import EventNotification
from impactcell.opcua.filters.content_filter import NULL, ContentFilter, browse_path

MAX_SELECT_CLAUSES: Final = 200
"""Fields of an event that one item reports; no type here has as many."""


class EventFilter:
    """What one monitored item wants of events.

    Raises
    ------
    StatusCodeError
        BadEventFilterInvalid: no filter, no fields, or a where clause that cannot be evaluated.
    """

    def __init__(self, space: AddressSpace, requested: Any) -> None:
        if not isinstance(requested, ua.EventFilter) or not (
            0 < len(requested.SelectClauses or []) <= MAX_SELECT_CLAUSES
        ):
            raise StatusCodeError(ua.StatusCodes.BadEventFilterInvalid)
        self._where = ContentFilter(space, requested.WhereClause.Elements or [])
        self._paths = [browse_path(clause) for clause in requested.SelectClauses]
        self.result = ua.EventFilterResult()
        self.result.SelectClauseResults = [
            ua.StatusCode(
                ua.StatusCodes.Good
                if clause.TypeDefinitionId in space
                else ua.StatusCodes.BadTypeDefinitionInvalid
            )
            for clause in requested.SelectClauses
        ]

    def select(self, event: EventNotification) -> ua.EventFieldList:
        """Take the wanted fields out of an event; a field that it does not have is null."""
        fields = ua.EventFieldList()
        fields.EventFields = [NULL if path is None else event.fields.get(path, NULL) for path in self._paths]
        return fields

    def passes(self, event: EventNotification) -> bool:
        """Whether the client wants to hear of an event."""
        return event.unfiltered or self._where.passes(event)
