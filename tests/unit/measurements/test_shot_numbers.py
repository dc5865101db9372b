"""Shots and batches keep the numbers that the files give them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from impactcell import campaign
from impactcell.errors import MeasurementError
from impactcell.measurements import Given, Imported, MeasuredColumn, Table, guess, make_campaign
from impactcell.measurements.given import read_given
from impactcell.web.texts.import_faults import page_fault
from tests.unit.measurements.records import sampled, taps

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


def test_shots_keep_the_numbers_of_their_column_and_their_order(tmp_path: Path) -> None:
    """They became 1, 2, 3: what was said of shot 2 was about the user's 107."""
    made = imported(driven((105.0, 112.0, 107.0)))
    campaign.write(made.campaign, tmp_path / "out")
    back = campaign.read(tmp_path / "out")
    assert [shot.cycle for shot in back.shots] == [105, 112, 107]
    assert sorted(trace.stem for trace in (tmp_path / "out" / "traces").iterdir()) == ["105", "107", "112"]
    apart = imported(driven((9.0, 7.0), channels=("F",)), driven((9.0, 7.0), "b.csv", ("x",)))
    assert [shot.cycle for shot in apart.campaign.shots] == [9, 7]


@pytest.mark.parametrize("numbers", [(0.0, 1.0), (1.5, 2.0), (-1.0, 2.0), (1e16, 2.0)])
def test_numbers_that_no_shot_can_have_are_counted_anew(numbers: Sequence[float]) -> None:
    assert [shot.cycle for shot in imported(driven(numbers)).campaign.shots] == [1, 2]


def test_numbers_of_several_files_count_where_each_is_there_once() -> None:
    later, again = driven((3.0, 4.0), "b.csv"), driven((2.0, 4.0), "b.csv")
    first = driven((1.0, 2.0))
    assert [shot.cycle for shot in imported(first, later).campaign.shots] == [1, 2, 3, 4]
    assert [shot.cycle for shot in imported(first, again).campaign.shots] == [1, 2, 3, 4]
    unnumbered = Table("c.csv", driven((5.0,)).columns[:-1])
    assert [shot.cycle for shot in imported(later, unnumbered).campaign.shots] == [1, 2, 3]


@pytest.mark.parametrize("is_turned", [False, True])
def test_taps_keep_the_numbers_of_their_column(*, is_turned: bool) -> None:
    rng = np.random.default_rng(2)
    parts = [sampled(tap, rng, tail_s=0.3) for tap in taps((3000, 3500), (18.9,))[::2]]
    numbers = np.repeat([107.0, 105.0], [len(part[0]) for part in parts])
    time, force, position = (np.concatenate([part[i] for part in parts]) for i in range(3))
    columns = {"t": ("s", time), "F": ("N", -force if is_turned else force), "x": ("m", position)}
    of = [MeasuredColumn(name, unit, values) for name, (unit, values) in columns.items()]
    tables = [Table("a.csv", (*of, MeasuredColumn("shot", None, numbers)))]
    given = Given(constants={"mass": 18.9, "velocity": 0.05, "stroke": 1.5e-3})
    made = make_campaign(tables, guess(tables, given))
    assert [shot.cycle for shot in made.campaign.shots] == [107, 105]
    # Two taps in each of the numbered records: none has a number of its own.
    cut = np.repeat([107.0, 105.0], 2 * len(time))
    step = np.median(np.diff(time))
    of = [MeasuredColumn(name, unit, np.tile(values, 4)) for name, (unit, values) in columns.items()]
    of[0] = MeasuredColumn("t", "s", step * np.arange(4 * len(time)))
    tables = [Table("a.csv", (*of, MeasuredColumn("shot", None, cut)))]
    made = make_campaign(tables, guess(tables, given))
    assert [shot.cycle for shot in made.campaign.shots] == list(range(1, 9))


def counted(name: str, numbers: np.ndarray) -> Table:
    """Give a tap at 10 kHz with a column of numbers, and no times."""
    _, force, position = sampled(taps((3000,), (18.9,))[0], np.random.default_rng(5))
    columns = (
        MeasuredColumn(name, None, np.resize(numbers, force.size)),
        MeasuredColumn("Kraft", "N", force),
        MeasuredColumn("Weg", "m", position),
    )
    said = {"Abtastrate": "10000 Hz", "Masse": "18.9 kg", "Vorschub": "3000 mm/min"}
    return Table("a.csv", columns, attributes=said)


@pytest.mark.parametrize("name", ["Nr.", "n", "Messung"])
@pytest.mark.parametrize("first", [0, 1])
def test_a_column_that_counts_the_samples_numbers_no_shots(name: str, first: int) -> None:
    """It was refused, where the file says its rate."""
    table = counted(name, np.arange(float(first), 10_000.0))
    mapping = guess([table])
    (item,) = (item for item in mapping.assignments if item.column == name)
    assert (str(item.meaning), item.why) == ("ignored", "counts the rows")
    (shot,) = make_campaign([table], mapping).campaign.shots
    assert shot.force is not None
    assert np.median(np.diff(shot.force.time_s)) == pytest.approx(1e-4)


def test_a_list_of_shots_beside_their_records_numbers_them() -> None:
    numbers = tuple(np.arange(1.0, 61.0))
    listed = (
        MeasuredColumn("shot", None, np.array(numbers)),
        MeasuredColumn("mass", "kg", 2.0 + np.array(numbers)),
    )
    tables = [driven(numbers, "a.h5"), Table("a.h5", listed)]
    found = make_campaign(tables, guess(tables)).campaign.shots
    assert [(shot.cycle, shot.mass_kg) for shot in found] == [(int(n), 2.0 + n) for n in numbers]


def test_the_way_out_of_what_numbers_no_shots_can_be_typed() -> None:
    table = counted("Nr.", np.concatenate([np.arange(300.0), np.arange(200.0)]))
    with pytest.raises(MeasurementError) as caught:
        make_campaign([table], guess([table]))
    told = str(caught.value)
    assert told.endswith("with --column shot=NAME, or leave this one out with --column 'ignored=Nr.'")
    given = read_given({"columns": ["ignored=Nr."]})
    assert len(make_campaign([table], guess([table], given)).campaign.shots) == 1
    assert page_fault(told, "de")[1].endswith("zählt also keine Stöße; unten im Formular eine andere wählen")
