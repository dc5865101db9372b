"""Where clauses (ContentFilter, Part 4, 7.7): three-valued truth of an event, each element evaluated once.

Mended: asyncua's OfType matches the very type only, so that a filter for ConditionType lets no alarm
through; it logs an exception for every operand it does not know, and follows operands that refer to each
other without end.

What an event costs is in proportion to the operands of the filter and to the texts it compares: elements
are evaluated from the last to the first, and operands refer forward only.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from asyncua import ua

from impactcell.opcua.address_space.node_references import supertypes
from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.event_notification import BrowsePath, EventNotification
from impactcell.opcua.filters.like_pattern import MAX_PATTERN, like

MAX_ELEMENTS: Final = 200
"""Elements of one where clause."""
MAX_OPERANDS: Final = 1_000
"""Operands of all its elements together."""
MAX_LITERAL: Final = 1_000
"""Longest array that stands in a where clause."""
MAX_PATH: Final = 10
"""Longest browse path of a field: twice the depth of the deepest."""
NULL: Final = ua.Variant()


def _comparison(compare: Callable[[Any, Any], bool]) -> Callable[..., bool | None]:
    def operator(left: Any, right: Any) -> bool | None:
        if left is None or right is None:
            return None
        try:
            return bool(compare(left, right))
        except TypeError:
            return None

    return operator


def _not(value: Any) -> bool | None:
    return not value if isinstance(value, bool) else None


def _and(left: Any, right: Any) -> bool | None:
    if left is False or right is False:
        return False
    return True if left is True and right is True else None


def _or(left: Any, right: Any) -> bool | None:
    if left is True or right is True:
        return True
    return False if left is False and right is False else None


_AT_LEAST: Final = _comparison(lambda a, b: a >= b)


def _between(value: Any, low: Any, high: Any) -> bool | None:
    return _and(_AT_LEAST(value, low), _AT_LEAST(high, value))


def _in_list(value: Any, *members: Any) -> bool | None:
    return None if value is None else value in members


def _like(value: Any, pattern: Any) -> bool | None:
    if isinstance(value, ua.LocalizedText):
        value = value.Text
    return like(value, pattern) if isinstance(value, str) and isinstance(pattern, str) else None


_OPERATORS: Final[Mapping[ua.FilterOperator, tuple[int, int, Callable[..., bool | None]]]] = {
    ua.FilterOperator.Equals: (2, 2, _comparison(lambda a, b: a == b)),
    ua.FilterOperator.IsNull: (1, 1, lambda a: a is None),
    ua.FilterOperator.GreaterThan: (2, 2, _comparison(lambda a, b: a > b)),
    ua.FilterOperator.LessThan: (2, 2, _comparison(lambda a, b: a < b)),
    ua.FilterOperator.GreaterThanOrEqual: (2, 2, _AT_LEAST),
    ua.FilterOperator.LessThanOrEqual: (2, 2, _comparison(lambda a, b: a <= b)),
    ua.FilterOperator.Like: (2, 2, _like),
    ua.FilterOperator.Not: (1, 1, _not),
    ua.FilterOperator.Between: (3, 3, _between),
    ua.FilterOperator.InList: (2, MAX_ELEMENTS, _in_list),
    ua.FilterOperator.And: (2, 2, _and),
    ua.FilterOperator.Or: (2, 2, _or),
}
"""Each operator's fewest and most operands, and what it says of them; None is null."""

Truths = dict[int, bool | None]
"""Truth of the elements that have been evaluated for an event."""
Operand = Callable[[EventNotification, Truths], Any]


class _Element(NamedTuple):
    operator: Callable[..., bool | None]
    operands: tuple[Operand, ...]
    refers_to: tuple[int, ...]


class ContentFilter:
    """A where clause.

    Raises
    ------
    StatusCodeError
        BadEventFilterInvalid: it cannot be evaluated, or is larger than is taken.
    """

    def __init__(self, space: AddressSpace, requested: list[ua.ContentFilterElement]) -> None:
        self._space = space
        if (
            len(requested) > MAX_ELEMENTS
            or sum(len(element.FilterOperands or []) for element in requested) > MAX_OPERANDS
        ):
            raise _invalid()
        elements = [self._element(index, element, len(requested)) for index, element in enumerate(requested)]
        needed = {0} if elements else set()
        for index, element in enumerate(elements):
            if index in needed:
                needed.update(element.refers_to)
        self._elements = [(index, elements[index]) for index in sorted(needed, reverse=True)]

    def passes(self, event: EventNotification) -> bool:
        """Whether the first element, which stands for the whole, is true of an event."""
        truths: Truths = {}
        for index, (operator, operands, _) in self._elements:
            truths[index] = operator(*[operand(event, truths) for operand in operands])
        return truths.get(0, True) is True

    def _element(self, index: int, requested: ua.ContentFilterElement, count: int) -> _Element:
        operands = requested.FilterOperands or []
        refers_to = tuple(o.Index for o in operands if isinstance(o, ua.ElementOperand))
        # An operand refers forward only: so no two can refer to each other.
        if any(not index < reference < count for reference in refers_to):
            raise _invalid()
        if requested.FilterOperator == ua.FilterOperator.OfType:
            if len(operands) != 1 or not isinstance(operands[0], ua.LiteralOperand):
                raise _invalid()
            event_type = _literal(operands[0])
            return _Element(bool, (lambda event, _: self._is_of_type(event, event_type),), ())
        if requested.FilterOperator not in _OPERATORS:
            raise _invalid()
        least, most, operator = _OPERATORS[requested.FilterOperator]
        if not least <= len(operands) <= most:
            raise _invalid()
        if operator is _like and isinstance(operands[1], ua.LiteralOperand):
            pattern = _literal(operands[1])
            if isinstance(pattern, str) and len(pattern) > MAX_PATTERN:
                raise _invalid()
        return _Element(operator, tuple(map(_operand, operands)), refers_to)

    def _is_of_type(self, event: EventNotification, event_type: Any) -> bool:
        return event_type in supertypes(self._space, event.event_type)


def browse_path(clause: ua.SimpleAttributeOperand) -> BrowsePath | None:
    """Give the path of a field; None for what no event has.

    Raises
    ------
    StatusCodeError
        BadEventFilterInvalid: the path is longer than is taken.
    """
    names = tuple(name.Name for name in _bounded(clause.BrowsePath))
    if not names:
        return () if clause.AttributeId == ua.AttributeIds.NodeId else None
    return names if clause.AttributeId == ua.AttributeIds.Value else None


def _operand(requested: Any) -> Operand:
    if isinstance(requested, ua.ElementOperand):
        index = requested.Index
        return lambda _, truths: truths[index]
    if isinstance(requested, ua.LiteralOperand):
        literal = _literal(requested)
        return lambda _event, _truths: literal
    if isinstance(requested, ua.AttributeOperand):
        path: BrowsePath | None = tuple(
            part.TargetName.Name for part in _bounded(requested.BrowsePath.Elements)
        )
    elif isinstance(requested, ua.SimpleAttributeOperand):
        path = browse_path(requested)
    else:
        raise _invalid()
    if path is None:
        return lambda _event, _truths: None
    return lambda event, _: event.fields.get(path, NULL).Value


def _literal(operand: ua.LiteralOperand) -> Any:
    value = operand.Value.Value if operand.Value is not None else None
    if isinstance(value, list) and len(value) > MAX_LITERAL:
        raise _invalid()
    return value


def _bounded(path: list[Any] | None) -> list[Any]:
    if path is not None and len(path) > MAX_PATH:
        raise _invalid()
    return path or []


def _invalid() -> StatusCodeError:
    return StatusCodeError(ua.StatusCodes.BadEventFilterInvalid)
