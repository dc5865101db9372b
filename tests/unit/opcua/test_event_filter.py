"""Event filters against the words of Part 4, and what they cost: no more than their size."""

import re
from collections.abc import Iterator, Mapping

import pytest
from asyncua import ua
from hypothesis import given
from hypothesis import strategies as st

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.event_notification import EventNotification
from impactcell.opcua.filters.event_filter import EventFilter
from impactcell.opcua.filters.like_pattern import LikePattern, like

Operator = ua.FilterOperator


class CountedFields(Mapping[tuple[str, ...], ua.Variant]):
    """Fields of an event that count how often they are looked at."""

    def __init__(self, **fields: object) -> None:
        self.fields = {(name,): ua.Variant(value) for name, value in fields.items()}
        self.looks = 0

    def __getitem__(self, path: tuple[str, ...]) -> ua.Variant:
        self.looks += 1
        return self.fields[path]

    def __iter__(self) -> Iterator[tuple[str, ...]]:
        return iter(self.fields)

    def __len__(self) -> int:
        return len(self.fields)


def field(name: str) -> ua.SimpleAttributeOperand:
    operand = ua.SimpleAttributeOperand()
    operand.TypeDefinitionId = ua.NodeId(ua.ObjectIds.BaseEventType)
    operand.BrowsePath = [ua.QualifiedName(name)]
    operand.AttributeId = ua.AttributeIds.Value
    return operand


def literal(value: object) -> ua.LiteralOperand:
    return ua.LiteralOperand(Value=ua.Variant(value))


def element(index: int) -> ua.ElementOperand:
    return ua.ElementOperand(Index=index)


def where(*elements: tuple[ua.FilterOperator, list[object]]) -> EventFilter:
    requested = ua.EventFilter()
    requested.SelectClauses = [field("Severity")]
    requested.WhereClause.Elements = [
        ua.ContentFilterElement(FilterOperator=operator, FilterOperands=operands)
        for operator, operands in elements
    ]
    return EventFilter(AddressSpace(), requested)


def event(**fields: object) -> EventNotification:
    return EventNotification(ua.NodeId(ua.ObjectIds.BaseEventType), CountedFields(**fields), frozenset())


def looks(event_filter: EventFilter) -> int:
    notification = event(Severity=500, Message="worn")
    event_filter.passes(notification)
    return notification.fields.looks


@pytest.mark.parametrize("operator", [Operator.And, Operator.Or])
@pytest.mark.parametrize("size", [2, 19, 150])
def test_an_element_is_evaluated_once_however_often_it_is_referred_to(
    operator: ua.FilterOperator, size: int
) -> None:
    """Each element names the next one twice: evaluated as a tree, the cost would double with each."""
    chain = [(operator, [element(i + 1), element(i + 1)]) for i in range(size - 1)]
    assert looks(where(*chain, (Operator.Equals, [field("Severity"), literal(500)]))) <= 1


def test_an_element_that_nothing_refers_to_costs_nothing() -> None:
    idle = [(Operator.Equals, [field("Severity"), literal(1)])] * 100
    assert looks(where((Operator.Equals, [field("Severity"), literal(500)]), *idle)) == 1


def test_more_operands_than_a_filter_may_have() -> None:
    long_list = [field("Severity"), *(literal(i) for i in range(199))]
    assert where(*[(Operator.InList, long_list)] * 5)
    with pytest.raises(StatusCodeError) as refused:
        where(*[(Operator.InList, long_list)] * 6)
    assert refused.value.code == ua.StatusCodes.BadEventFilterInvalid


@pytest.mark.parametrize(
    "operand",
    [
        ua.LiteralOperand(Value=ua.Variant([0] * 1_001)),
        ua.SimpleAttributeOperand(BrowsePath=[ua.QualifiedName("x")] * 11, AttributeId=ua.AttributeIds.Value),
        ua.AttributeOperand(BrowsePath=ua.RelativePath([ua.RelativePathElement()] * 11)),
        ua.FilterOperand(),
    ],
    ids=["array", "path", "relative path", "none of the four"],
)
def test_operands_that_are_larger_than_is_taken(operand: object) -> None:
    with pytest.raises(StatusCodeError) as refused:
        where((Operator.IsNull, [operand]))
    assert refused.value.code == ua.StatusCodes.BadEventFilterInvalid


def test_truth_of_nested_elements() -> None:
    """(Severity > 400 and not (Message like 'x%')) or SourceName is null, three-valued."""
    nested = where(
        (Operator.Or, [element(1), element(4)]),
        (Operator.And, [element(2), element(3)]),
        (Operator.GreaterThan, [field("Severity"), literal(400)]),
        (Operator.Not, [element(5)]),
        (Operator.Equals, [field("SourceName"), literal("press-1")]),
        (Operator.Like, [field("Message"), literal("x%")]),
    )
    assert nested.passes(event(Severity=500, Message="worn"))
    assert not nested.passes(event(Severity=500, Message="x-ray"))
    assert not nested.passes(event(Severity=300, Message="worn"))
    assert nested.passes(event(Severity=300, SourceName="press-1"))
    assert not nested.passes(event(Message="worn")), "null is not greater than 400, nor is it not"


def test_a_pattern_that_is_a_field_of_the_event() -> None:
    both = where((Operator.Like, [field("Message"), field("Comment")]))
    assert both.passes(event(Message="worn", Comment="w%n"))
    assert not both.passes(event(Message="worn", Comment="x%"))
    assert not both.passes(event(Message="worn"))


def test_a_pattern_longer_than_is_taken() -> None:
    assert where((Operator.Like, [field("Message"), literal("a" * 1_000)]))
    with pytest.raises(StatusCodeError) as refused:
        where((Operator.Like, [field("Message"), literal("a" * 1_001)]))
    assert refused.value.code == ua.StatusCodes.BadEventFilterInvalid


class CountedText(str):
    """A text that counts the characters that are taken from it."""

    __slots__ = ("taken",)

    def __iter__(self) -> Iterator[str]:
        self.taken = 0
        for character in super().__iter__():
            self.taken += 1
            yield character


@pytest.mark.parametrize("pattern", ["%_" * 6 + "b", "%a" * 200 + "b", "%" * 500, "%[ab]%_" * 100 + "c"])
def test_each_character_of_a_text_is_looked_at_once(pattern: str) -> None:
    """As a backtracking expression the first of these takes a time of the sixth power of the text."""
    text = CountedText("a" * 4_000)
    LikePattern(pattern).matches(text)
    assert text.taken <= len(text)


def oracle(pattern: str) -> str:
    """The pattern as a regular expression, written apart for patterns of these characters."""
    out, rest = "", pattern
    while rest:
        if match := re.match(r"\[(\^?)([ab]+)\]", rest):
            out, rest = out + f"[{match[1]}{match[2]}]", rest[match.end() :]
            continue
        out += {"%": ".*", "_": "."}.get(rest[0], re.escape(rest[0]))
        rest = rest[1:]
    return out


PIECES = st.sampled_from(["%", "_", "a", "b", "[a]", "[^a]", "[ab]", "[^ab]"])


@given(st.lists(PIECES, max_size=8), st.text("abc\n", max_size=9))
def test_patterns_against_regular_expressions(pieces: list[str], text: str) -> None:
    pattern = "".join(pieces)
    assert like(text, pattern) == (re.fullmatch(oracle(pattern), text, re.DOTALL) is not None)
