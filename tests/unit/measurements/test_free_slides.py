"""Parts that slide freely: nothing is struck, and which way they go is said or seen."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from impactcell import campaign
from impactcell.campaign import Excitation
from impactcell.measurements import Imported, MeasuredColumn, Table, guess, make_campaign, write_campaign
from impactcell.measurements.given import read_given

DECELERATION_M_S2 = 1.5
SPEEDS = (0.2, -0.25, 0.3, -0.2)


def slides(speeds: Sequence[float] = SPEEDS, name: str = "", said: Sequence[float] = ()) -> list[Table]:
    """Parts that begin at 12 mm with a speed and come to rest; a column of direction where it has a name."""
    time, tables = np.arange(3000) * 1e-4, []
    rng = np.random.default_rng(4)
    for number, speed in enumerate(speeds):
        since = np.minimum(time, abs(speed) / DECELERATION_M_S2)
        way = 0.012 + np.sign(speed) * (abs(speed) * since - 0.5 * DECELERATION_M_S2 * since**2)
        columns = [MeasuredColumn("t", "s", time)]
        columns.append(MeasuredColumn("x", "m", way + 1e-6 * rng.normal(size=time.size)))
        if name:
            columns.append(MeasuredColumn(name, None, np.full(time.size, said[number])))
        tables.append(Table(f"slide{number}.csv", tuple(columns)))
    return tables


def imported(tables: Sequence[Table], **said: list[str]) -> Imported:
    return make_campaign(tables, guess(tables, read_given(said)))


def test_the_direction_of_a_column_is_that_of_the_slide(tmp_path: Path) -> None:
    """It was found, left out, and +1 written for all."""
    tables = slides(name="Richtung", said=[1.0, -1.0, 1.0, -1.0])
    write_campaign(tables, guess(tables), tmp_path / "out")
    back = campaign.read(tmp_path / "out")
    assert back.excitation is Excitation.FREE_SLIDE
    assert [shot.direction for shot in back.shots] == [1, -1, 1, -1]


def test_where_nothing_says_the_direction_it_is_the_way_that_the_part_goes() -> None:
    assert [shot.direction for shot in imported(slides()).campaign.shots] == [1, -1, 1, -1]


@pytest.mark.parametrize("sign", [1, -1])
def test_a_direction_that_is_given_is_that_of_every_slide(sign: int) -> None:
    made = imported(slides([0.2 * sign, 0.3 * sign]), constants=[f"direction={sign}"])
    assert [shot.direction for shot in made.campaign.shots] == [sign, sign]
    assert not any("not used" in note for note in made.notes)
