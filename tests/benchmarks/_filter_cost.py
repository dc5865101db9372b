"""What an event costs a filter, against the size of the filter: the worst that a client may ask for."""

import time

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.event_notification import EventNotification
from impactcell.opcua.filters.content_filter import MAX_ELEMENTS
from impactcell.opcua.filters.event_filter import EventFilter
from impactcell.opcua.filters.like_pattern import MAX_PATTERN
from tests.benchmarks.table import Table

SIZES = (5, 19, 50, MAX_ELEMENTS)
PATTERNS = (6, 50, 200, MAX_PATTERN // 2)
TEXT = "a" * 1_000
BAR_MS = 1.0
"""A tenth of what one client's request may cost another."""


def _field(name: str) -> ua.SimpleAttributeOperand:
    return ua.SimpleAttributeOperand(
        TypeDefinitionId=ua.NodeId(ua.ObjectIds.BaseEventType),
        BrowsePath=[ua.QualifiedName(name)],
        AttributeId=ua.AttributeIds.Value,
    )


def _filter(*elements: tuple[ua.FilterOperator, list[object]]) -> EventFilter:
    requested = ua.EventFilter()
    requested.SelectClauses = [_field("Message")]
    requested.WhereClause.Elements = [
        ua.ContentFilterElement(FilterOperator=operator, FilterOperands=operands)
        for operator, operands in elements
    ]
    return EventFilter(AddressSpace(), requested)


def chain(size: int) -> EventFilter:
    """Make a filter in which each element names the next one twice."""
    elements: list[tuple[ua.FilterOperator, list[object]]] = [
        (ua.FilterOperator.And, [ua.ElementOperand(Index=i + 1), ua.ElementOperand(Index=i + 1)])
        for i in range(size - 1)
    ]
    text = ua.LiteralOperand(Value=ua.Variant("worn"))
    return _filter(*elements, (ua.FilterOperator.Equals, [_field("Message"), text]))


def pattern(pairs: int) -> EventFilter:
    """Make a filter with a pattern that can be laid on a text in very many ways."""
    text = ua.LiteralOperand(Value=ua.Variant(("%_" * pairs)[: MAX_PATTERN - 1] + "b"))
    return _filter((ua.FilterOperator.Like, [_field("Message"), text]))


def cost_ms(event_filter: EventFilter, message: str, times: int = 20) -> float:
    """Median time of one event, milliseconds."""
    event = EventNotification(
        ua.NodeId(ua.ObjectIds.BaseEventType), {("Message",): ua.Variant(message)}, frozenset()
    )
    taken = []
    for _ in range(times):
        begin = time.perf_counter()
        event_filter.passes(event)
        taken.append(time.perf_counter() - begin)
    return 1e3 * sorted(taken)[times // 2]


def table() -> Table:
    """Measure."""
    bar = f"<= {BAR_MS:g} ms"
    rows = [
        (f"And(i+1, i+1), {size} elements", bar, f"{cost_ms(chain(size), 'worn'):.3f} ms") for size in SIZES
    ]
    rows += [
        (f"Like, {size} times %_, 1000 characters", bar, f"{cost_ms(pattern(size), TEXT):.3f} ms")
        for size in PATTERNS
    ]
    return Table("OPC UA event filters, an event", ("what", "bar", "measured"), rows)
