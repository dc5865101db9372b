"""Faults of many files: alike ones are told once, all are counted."""

import pytest

from impactcell.errors import MeasurementError
from impactcell.measurements.faults import MAX_FAULTS_TOLD, raise_faults


def told(faults: list[str]) -> list[str]:
    with pytest.raises(MeasurementError) as raised:
        raise_faults(faults)
    return str(raised.value).splitlines()


def test_like_faults_of_ten_files_are_one_with_a_count() -> None:
    alike = [f"{number}.csv: shot {number}: no contact in {number}.5 s" for number in range(1, 11)]
    other = "3.csv:12: column 'force' is empty"
    assert told([*alike[:3], other, *alike[3:]]) == [f"{alike[0]} (and 9 more like this)", other]


def test_faults_of_columns_with_other_names_are_told_apart() -> None:
    faults = [f"a.csv:{number}: column 'c{number}' is empty" for number in range(1, 4)]
    assert told(faults) == faults


def test_what_is_not_told_is_counted() -> None:
    kinds = [f"{file}.csv: column 'c{kind}' is empty" for kind in range(MAX_FAULTS_TOLD + 2) for file in "ab"]
    lines = told(kinds)
    assert len(lines) == MAX_FAULTS_TOLD + 1
    assert lines[-1] == "and 4 more faults"


def test_nothing_is_raised_where_there_is_no_fault() -> None:
    raise_faults([])
