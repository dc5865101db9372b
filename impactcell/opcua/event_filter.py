"""EventNotification filters: which events a client wants, and which of their fields (Part 4, 7.7 and 7.22.3).

Mended: asyncua's OfType matches the very type only, so that a filter for ConditionType lets no alarm
through; it logs an exception for every operand it does not know, and follows operands that refer to each
other without end.
"""

import re
from collections.abc import Callable, Mapping
from typing import Any, Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.event_notification import BrowsePath, EventNotification
from impactcell.opcua.type_instances import supertypes

NULL: Final = ua.Variant()
MAX_CLAUSES: Final = 200
"""Longest select clause and longest where clause, elements; no type here has as many fields."""


def _ordered(compare: Callable[[Any, Any], bool]) -> Callable[..., bool | None]:
    def operator(left: Any, right: Any) -> bool | None:
        if left is None or right is None:
            return None
        try:
            return compare(left, right)
        except TypeError:
            return None

    return operator


def _not(value: bool | None) -> bool | None:  # noqa: FBT001
    return None if value is None else not value


def _and(left: bool | None, right: bool | None) -> bool | None:  # noqa: FBT001
    if left is False or right is False:
        return False
    return None if left is None or right is None else True


def _or(left: bool | None, right: bool | None) -> bool | None:  # noqa: FBT001
    if left is True or right is True:
        return True
    return None if left is None or right is None else False


def _between(value: Any, low: Any, high: Any) -> bool | None:
    at_least = _ordered(lambda a, b: a >= b)
    return _and(at_least(value, low), at_least(high, value))


def _like(value: Any, pattern: Any) -> bool | None:
    if isinstance(value, ua.LocalizedText):
        value = value.Text
    return like(value, pattern) if isinstance(value, str) and isinstance(pattern, str) else None


def like(text: str, pattern: str) -> bool:
    r"""Match the LIKE patterns of Part 4, table 120: % any characters, _ one, [a-f] [^c] sets, \\ escapes.

    >>> like("WearLimit", "Wear%"), like("cell-3", "cell-[1-2]")
    (True, False)
    """
    expression, position = "", 0
    while position < len(pattern):
        character = pattern[position]
        if character == "\\" and position + 1 < len(pattern):
            position += 1
            expression += re.escape(pattern[position])
        elif character == "%":
            expression += ".*"
        elif character == "_":
            expression += "."
        elif character == "[" and "]" in pattern[position + 2 :]:
            end = pattern.index("]", position + 2)
            expression += "[" + pattern[position + 1 : end].replace("\\", r"\\").replace("[", r"\[") + "]"
            position = end
        else:
            expression += re.escape(character)
        position += 1
    try:
        return re.fullmatch(expression, text, re.DOTALL) is not None
    except re.error:
        return False


_OPERATORS: Final[Mapping[ua.FilterOperator, tuple[int, int, Callable[..., bool | None]]]] = {
    ua.FilterOperator.Equals: (2, 2, _ordered(lambda a, b: bool(a == b))),
    ua.FilterOperator.IsNull: (1, 1, lambda a: a is None),
    ua.FilterOperator.GreaterThan: (2, 2, _ordered(lambda a, b: a > b)),
    ua.FilterOperator.LessThan: (2, 2, _ordered(lambda a, b: a < b)),
    ua.FilterOperator.GreaterThanOrEqual: (2, 2, _ordered(lambda a, b: a >= b)),
    ua.FilterOperator.LessThanOrEqual: (2, 2, _ordered(lambda a, b: a <= b)),
    ua.FilterOperator.Like: (2, 2, _like),
    ua.FilterOperator.Not: (1, 1, _not),
    ua.FilterOperator.Between: (3, 3, _between),
    ua.FilterOperator.InList: (2, MAX_CLAUSES, lambda a, *members: None if a is None else a in members),
    ua.FilterOperator.And: (2, 2, _and),
    ua.FilterOperator.Or: (2, 2, _or),
}


class EventFilter:
    """What one monitored item wants of events.

    Raises
    ------
    FaultError
        BadEventFilterInvalid: no filter, no fields, or a where clause that cannot be evaluated.
    """

    def __init__(self, space: AddressSpace, requested: Any) -> None:
        if not isinstance(requested, ua.EventFilter):
            raise StatusCodeError(ua.StatusCodes.BadEventFilterInvalid)
        if not 0 < len(requested.SelectClauses) <= MAX_CLAUSES:
            raise StatusCodeError(ua.StatusCodes.BadEventFilterInvalid)
        self._space = space
        self._elements = requested.WhereClause.Elements or []
        if len(self._elements) > MAX_CLAUSES:
            raise StatusCodeError(ua.StatusCodes.BadEventFilterInvalid)
        for index, element in enumerate(self._elements):
            self._check_element(index, element)
        self._paths = [self._browse_path(clause) for clause in requested.SelectClauses]
        self.result = ua.EventFilterResult()
        self.result.SelectClauseResults = [
            self._select_clause_result(clause) for clause in requested.SelectClauses
        ]

    def _check_element(self, index: int, element: ua.ContentFilterElement) -> None:
        operands = element.FilterOperands or []
        if element.FilterOperator == ua.FilterOperator.OfType:
            fits = len(operands) == 1 and isinstance(operands[0], ua.LiteralOperand)
        elif element.FilterOperator in _OPERATORS:
            min_operands, max_operands, _ = _OPERATORS[element.FilterOperator]
            fits = min_operands <= len(operands) <= max_operands
        else:
            fits = False
        for operand in operands:
            if isinstance(operand, ua.ElementOperand):
                # An operand refers forward only: so no two can refer to each other.
                fits = fits and index < operand.Index < len(self._elements)
            elif not isinstance(operand, ua.LiteralOperand | ua.SimpleAttributeOperand | ua.AttributeOperand):
                fits = False
        if not fits:
            raise StatusCodeError(ua.StatusCodes.BadEventFilterInvalid)

    def _select_clause_result(self, clause: ua.SimpleAttributeOperand) -> ua.StatusCode:
        is_known = clause.TypeDefinitionId in self._space
        return ua.StatusCode(ua.StatusCodes.Good if is_known else ua.StatusCodes.BadTypeDefinitionInvalid)

    @staticmethod
    def _browse_path(clause: ua.SimpleAttributeOperand) -> BrowsePath | None:
        names = tuple(name.Name for name in clause.BrowsePath or [])
        if not names:
            return () if clause.AttributeId == ua.AttributeIds.NodeId else None
        return names if clause.AttributeId == ua.AttributeIds.Value else None

    def select(self, event: EventNotification) -> ua.EventFieldList:
        """Take the wanted fields out of an event; a field that it does not have is null."""
        fields = ua.EventFieldList()
        fields.EventFields = [NULL if path is None else event.fields.get(path, NULL) for path in self._paths]
        return fields

    def passes(self, event: EventNotification) -> bool:
        """Whether the client wants to hear of an event."""
        return event.unfiltered or not self._elements or self._evaluate(0, event) is True

    def _evaluate(self, index: int, event: EventNotification) -> bool | None:
        element = self._elements[index]
        operands = [self._evaluate_operand(operand, event) for operand in element.FilterOperands]
        if element.FilterOperator == ua.FilterOperator.OfType:
            return operands[0] in supertypes(self._space, event.event_type)
        return _OPERATORS[element.FilterOperator][2](*operands)

    def _evaluate_operand(self, operand: Any, event: EventNotification) -> Any:
        if isinstance(operand, ua.ElementOperand):
            return self._evaluate(operand.Index, event)
        if isinstance(operand, ua.LiteralOperand):
            return operand.Value.Value if operand.Value is not None else None
        if isinstance(operand, ua.AttributeOperand):
            names = tuple(part.TargetName.Name for part in operand.BrowsePath.Elements or [])
            return event.fields.get(names, NULL).Value
        path = self._browse_path(operand)
        return None if path is None else event.fields.get(path, NULL).Value
