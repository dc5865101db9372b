"""Whole numbers whose thousands are separated are no decimals: what may be either is refused."""

from pathlib import Path

import numpy as np
import pytest

from impactcell.errors import MeasurementError
from impactcell.measurements import Dialect, Table, read_tables
from impactcell.web.texts.import_faults import page_fault

FORCES_MN = [0, 3, -398, 999, 1000, -1044, 186_957, 93_020, 412, -7] * 40
"""Counts of a load cell, as a recorder of whole millinewtons has them."""
TIMES_US = [100 * i for i in range(400)]


def written(values: list[int], separator: str) -> list[str]:
    return [f"{value:,}".replace(",", separator) for value in values]


def one(path: Path, text: str, dialect: Dialect | None = None) -> Table:
    path.write_text(text, encoding="utf-8")
    (table,) = read_tables(path, None, dialect)
    return table


@pytest.mark.parametrize(("separator", "is_mark_of"), [(".", "comma"), (",", "point")])
@pytest.mark.parametrize("beside", [FORCES_MN, TIMES_US])
def test_separated_thousands_are_refused_and_can_be_said(
    tmp_path: Path, separator: str, is_mark_of: str, beside: list[int]
) -> None:
    rows = zip(written(beside, separator), written(FORCES_MN, separator), strict=True)
    text = "x;Kraft [mN]\n" + "".join(f"{first};{force}\n" for first, force in rows)
    with pytest.raises(MeasurementError) as caught:
        one(tmp_path / "a.csv", text)
    told = str(caught.value)
    assert "beside whole ones up to 999, which may be thousands; say --decimal " + is_mark_of in told
    assert page_fault(told, "de")[0] == "de"
    assert "--" not in page_fault(told, "en")[1] + page_fault(told, "de")[1]
    said = one(tmp_path / "a.csv", text, Dialect(decimal={"comma": ",", "point": "."}[is_mark_of]))
    np.testing.assert_array_equal([column.values for column in said.columns], [beside, FORCES_MN])
    as_said = one(tmp_path / "a.csv", text, Dialect(decimal=separator))
    assert as_said.columns[1].values[6] == 186.957


@pytest.mark.parametrize("decimals", [".", ","])
@pytest.mark.parametrize(
    "values",
    [
        ["1.250", "0.125", "3", "4.500"],  # a zero before the mark
        ["1.25", "2.125", "3", "4.5"],  # as few digits as will do
        ["1.250", "2.125", "3.000", "12.875"],  # always three digits
        ["1.125", "2", "1200", "12.875"],  # thousands that are not separated
        ["1", "2", "-3", "400"],
    ],
)
def test_decimals_are_read_as_they_are(tmp_path: Path, decimals: str, values: list[str]) -> None:
    cells = [cell.replace(".", decimals) for cell in values] * 20
    text = "n;F\n" + "".join(f"{row};{cell}\n" for row, cell in enumerate(cells))
    dialect = Dialect(decimal=decimals) if all(decimals not in cell for cell in cells) else None
    table = one(tmp_path / "a.csv", text, dialect)
    np.testing.assert_array_equal(table.columns[1].values, [float(cell) for cell in values] * 20)


def test_one_decimal_mark_tells_it_of_all_columns(tmp_path: Path) -> None:
    text = "t;T\n" + "".join(f"{0.05 * row:.2f};{'24.875' if row % 9 else '25'}\n" for row in range(60))
    assert one(tmp_path / "a.csv", text).columns[1].values[1] == 24.875


def test_a_number_with_the_other_mark_names_the_option(tmp_path: Path) -> None:
    rows = [f"{row};{row % 7}.5" for row in range(400)]
    rows[3] = "3;1.234.567"
    with pytest.raises(MeasurementError, match=r":5: .*'1\.234\.567' .* point; say --decimal comma if that"):
        one(tmp_path / "a.csv", "n;F\n" + "\n".join(rows))
