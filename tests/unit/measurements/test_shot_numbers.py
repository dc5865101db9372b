"""Shots and batches keep the numbers that the files give them."""

from collections.abc import Sequence

import numpy as np
import pytest

from impactcell.errors import MeasurementError
from impactcell.measurements import Imported, MeasuredColumn, Table, guess, make_campaign
from impactcell.measurements.given import read_given

ROWS = 400


def driven(
    numbers: Sequence[float],
    source: str = "a.csv",
    channels: Sequence[str] = ("F", "x"),
    **more: Sequence[float],
) -> Table:
    """Records of what is driven, one below the other, with a column of shots and further ones."""
    time = np.arange(ROWS) * 1e-3
    waves = {"F": ("N", np.sin(20.0 * time)), "x": ("m", np.cos(20.0 * time))}
    columns = [MeasuredColumn("t", "s", np.tile(time, len(numbers)))]
    for name in channels:
        unit, values = waves[name]
        columns.append(MeasuredColumn(name, unit, np.concatenate([values * (1.0 + n % 7) for n in numbers])))
    for name, of_shots in {"shot": numbers, **more}.items():
        columns.append(MeasuredColumn(name, None, np.repeat(np.array(of_shots, dtype=float), ROWS)))
    return Table(source, tuple(columns))


def imported(*tables: Table) -> Imported:
    return make_campaign(tables, guess(tables, read_given({"constants": ["mass=2kg"]})))


@pytest.mark.parametrize(
    ("numbers", "batches"),
    [
        ((20240131.0, 20240132.0, 1e9 + 1.0), ["20240131", "20240132", "1000000001"]),
        ((7.0, 0.1, 1.25), ["7", "0.1", "1.25"]),
    ],
)
def test_batches_are_told_apart_however_long_their_numbers(
    numbers: Sequence[float], batches: Sequence[str]
) -> None:
    """Two days in the same month were one batch."""
    made = imported(driven((1.0, 2.0, 3.0), batch=numbers))
    assert [shot.batch_id for shot in made.campaign.shots] == batches


def test_what_differs_is_shown_as_differing() -> None:
    force = driven((20240131.0,), channels=("F",), batch=(20240131.0,))
    with pytest.raises(MeasurementError, match=r"holds shot 20240132, where .* holds shot 20240131; name"):
        imported(force, driven((20240132.0,), "b.csv", ("x",)))
    with pytest.raises(MeasurementError, match=r"says batch 20240132 and .*, 20240131; correct one"):
        imported(force, driven((20240131.0,), "b.csv", ("x",), batch=(20240132.0,)))
    batches = 20240131.0 + (np.arange(ROWS) >= ROWS // 2)
    one = Table("a.csv", (*driven((1.0,)).columns, MeasuredColumn("batch", None, batches)))
    with pytest.raises(MeasurementError, match=r"\(batch\) is 20240131 and 20240132 within one record"):
        imported(one)
