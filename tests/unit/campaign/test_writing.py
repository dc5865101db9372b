"""What is written reads back to the same values, and nothing is ever overwritten."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from impactcell.campaign import Campaign, Excitation, Sensor, read, write
from impactcell.errors import CampaignError
from impactcell.records import Capture, Channel

FINITE = st.floats(-1e6, 1e6, allow_nan=False)


@st.composite
def channels(draw: st.DrawFn) -> Channel:
    count = draw(st.integers(1, 8))
    steps = draw(arrays.arrays(np.float64, count, elements=st.floats(1e-6, 1.0)))
    values = draw(arrays.arrays(np.float64, count, elements=FINITE))
    return Channel(np.cumsum(steps), values, 0.4)


@st.composite
def captures(draw: st.DrawFn, number: int) -> Capture:
    return Capture(
        cycle=number,
        velocity_m_s=draw(st.floats(1e-3, 0.2)),
        mass_kg=draw(st.one_of(st.just(float("nan")), st.floats(0.1, 50))),
        force=draw(channels()),
        position=draw(st.one_of(st.none(), channels())),
        actuator=draw(st.one_of(st.none(), channels())),
        direction=draw(st.sampled_from([1, -1])),
        stroke_m=0.0015,
        batch_id=draw(st.one_of(st.none(), st.text("ABC,\" '", min_size=1).map(str.strip).filter(bool))),
        dwell_s=draw(st.one_of(st.just(float("nan")), st.floats(0, 1e4))),
        start_m=0.0,
        covariates={"temperature_c": draw(FINITE)},
    )


def same(left: Channel | None, right: Channel | None) -> bool:
    if left is None or right is None:
        return left is right
    return bool((left.time_s == right.time_s).all() and (left.values == right.values).all())


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(data=st.data(), count=st.integers(1, 4))
def test_round_trip(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, count: int) -> None:
    columns = (
        "shot",
        "velocity_mm_per_min",
        "mass_kg",
        "direction",
        "batch",
        "dwell_s",
        "start_m",
        "temperature_c",
    )
    shots = tuple(data.draw(captures(number + 1)) for number in range(count))
    sensors = {"force": Sensor(1e4, 0.4), "position": Sensor(None, None), "actuator": Sensor(1e3, 1e-6)}
    before = Campaign(Excitation.TAP, shots, 9.8, 0.0015, sensors, columns)
    directory = tmp_path_factory.mktemp("round") / "c"
    write(before, directory)
    after = read(directory)
    assert (after.gravity_m_s2, after.stroke_m, after.sensors, after.columns) == (
        9.8,
        0.0015,
        sensors,
        columns,
    )
    for left, right in zip(before.shots, after.shots, strict=True):
        assert all(
            same(getattr(left, name), getattr(right, name)) for name in ("force", "position", "actuator")
        )
        for name in ("cycle", "direction", "batch_id", "start_m", "covariates"):
            assert getattr(left, name) == getattr(right, name)
        for name in ("mass_kg", "dwell_s"):
            np.testing.assert_equal(getattr(left, name), getattr(right, name))
        assert right.velocity_m_s == pytest.approx(left.velocity_m_s, rel=1e-15)


def one_shot() -> Campaign:
    channel = Channel(np.array([0.0, 1.0]), np.array([0.0, 2.0]))
    return Campaign(Excitation.FREE_SLIDE, (Capture(1, float("nan"), 1.0, None, channel),))


def test_never_overwrites(tmp_path: Path) -> None:
    write(one_shot(), tmp_path / "c")
    kept = (tmp_path / "c" / "campaign.yaml").read_bytes()
    with pytest.raises(CampaignError, match="exists already"):
        write(one_shot(), tmp_path / "c")
    assert (tmp_path / "c" / "campaign.yaml").read_bytes() == kept


def test_an_empty_directory_is_filled_and_nothing_is_left_beside(tmp_path: Path) -> None:
    (tmp_path / "c").mkdir()
    write(one_shot(), tmp_path / "c")
    assert [entry.name for entry in tmp_path.iterdir()] == ["c"]
    assert read(tmp_path / "c").excitation is Excitation.FREE_SLIDE


def test_same_number_twice_is_refused(tmp_path: Path) -> None:
    campaign = one_shot()
    with pytest.raises(CampaignError, match="same number"):
        write(Campaign(Excitation.FREE_SLIDE, campaign.shots * 2), tmp_path / "c")
    assert not list(tmp_path.iterdir())


def test_unwritable_place(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CampaignError, match="cannot be written"):
        write(one_shot(), tmp_path / "file" / "c")
