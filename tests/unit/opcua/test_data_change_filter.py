"""Change filters, index ranges, LIKE patterns and the bounded codec, against the words of Part 4."""

import contextlib
import fnmatch
import math

import pytest
from asyncua import ua
from asyncua.ua import ua_binary
from hypothesis import given
from hypothesis import strategies as st

from impactcell.opcua.asyncua_adapter import StrictBuffer, bound_null_arrays
from impactcell.opcua.binary_codec import DecodingError, StatusCodeError, decode
from impactcell.opcua.filters.data_change_filter import DataChangeFilter, cut, parse_range, same
from impactcell.opcua.filters.like_pattern import like

TRIGGER = ua.DataChangeTrigger


def value(number: object, status: int = 0, second: int = 0) -> ua.DataValue:
    time = ua.win_epoch_to_datetime(130_000_000_000_000_000 + second * 10_000_000)
    return ua.DataValue(ua.Variant(number), ua.StatusCode(status), time)


@given(st.lists(st.floats(-1, 1, allow_nan=False), min_size=1, max_size=50), st.floats(0.01, 0.5))
def test_no_unreported_value_is_farther_than_the_deadband(values: list[float], deadband: float) -> None:
    watched = DataChangeFilter(TRIGGER.StatusValue, deadband)
    reported = math.nan
    for number in values:
        if watched.passes(value(number)):
            assert math.isnan(reported) or abs(number - reported) > deadband
            reported = number
        else:
            assert abs(number - reported) <= deadband


def test_triggers() -> None:
    status = DataChangeFilter(TRIGGER.Status, 0.0)
    assert [status.passes(v) for v in (value(1.0), value(2.0), value(2.0, 0x80000000))] == [True, False, True]
    timestamp = DataChangeFilter(TRIGGER.StatusValueTimestamp, 0.0)
    assert [timestamp.passes(v) for v in (value(1.0), value(1.0), value(1.0, second=1))] == [
        True,
        False,
        True,
    ]


def test_nan_is_the_same_as_nan() -> None:
    watched = DataChangeFilter(TRIGGER.StatusValue, 0.0)
    numbers = (math.nan, math.nan, 1.0, [math.nan, 1.0], [math.nan, 1.0], [math.nan, 2.0])
    assert [watched.passes(value(n)) for n in numbers] == [True, False, True, True, False, True]
    banded = DataChangeFilter(TRIGGER.StatusValue, 0.5)
    numbers = (1.0, math.nan, math.nan, math.inf, math.inf, 1.0)
    assert [banded.passes(value(n)) for n in numbers] == [True, True, False, True, False, True]
    assert not same(1, "1")


@pytest.mark.parametrize("text", ["-1", "1:", ":3", "3:3", "4:2", "a", "1,2", "1:2:3", " 1", "٣", "9" * 5000])
def test_bad_index_ranges(text: str) -> None:
    with pytest.raises(StatusCodeError) as refused:
        parse_range(text)
    assert refused.value.code == ua.StatusCodes.BadIndexRangeInvalid


def test_cut() -> None:
    array = value([1.0, 2.0, 3.0])
    assert cut(array, (1, 9)).Value.Value == [2.0, 3.0]
    assert cut(value("friction"), (0, 2)).Value.Value == "fri"
    for data, span in ((array, (3, 5)), (value(1.0), (0, 1))):
        assert cut(data, span).StatusCode.value == ua.StatusCodes.BadIndexRangeNoData


@given(st.text("ab%_*?", max_size=8), st.text("ab", max_size=8))
def test_like_against_shell_patterns(pattern: str, text: str) -> None:
    shell = pattern.replace("*", "[*]").replace("?", "[?]").replace("%", "*").replace("_", "?")
    assert like(text, pattern) == fnmatch.fnmatchcase(text, shell)


def test_like_sets_and_escapes() -> None:
    assert like("th1s", "th[ia1]s")
    assert not like("thos", "th[^o]s")
    assert like("5%", "5\\%")
    assert not like("5x", "5\\%")
    assert not like("a", "[")


@given(st.binary(max_size=200))
def test_noise_is_refused_with_one_exception(data: bytes) -> None:
    bound_null_arrays()
    for kind in (
        ua.ReadParameters,
        ua.CallParameters,
        ua.CreateMonitoredItemsParameters,
        ua.ActivateSessionParameters,
    ):
        with contextlib.suppress(DecodingError):
            decode(kind, StrictBuffer(data))


def test_lengths_that_lie() -> None:
    bound_null_arrays()
    bomb = b"\x80" + (2**31 - 1).to_bytes(4, "little")
    with pytest.raises(ua.UaError):
        ua_binary.variant_from_binary(StrictBuffer(bomb))
    with pytest.raises(ua.UaError):
        ua_binary.variant_from_binary(StrictBuffer(b"\x8c\x05\x00\x00\x00\xfe\xff\xff\xff"))
    assert ua_binary.variant_from_binary(StrictBuffer(b"\x80\x02\x00\x00\x00")).Value == [None, None]
