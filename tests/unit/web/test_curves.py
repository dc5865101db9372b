"""Curves of a screen's width: no peak is lost, and a band is where most curves are."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.records import Channel
from impactcell.web.cell_view import CellView
from impactcell.web.curves import Curve, decimate, envelope
from impactcell.web.interface import CellNews
from tests.snapshots import make_capture, make_snapshot


@given(st.integers(1, 5000), st.integers(2, 400), st.integers(0, 2**32 - 1))
def test_columns_hold_every_sample(count: int, columns: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    values = random.normal(size=count)
    curve = decimate(Channel(np.arange(count, dtype=float), values), columns)
    assert len(curve.x) == min(count, columns)
    assert np.all(np.diff(curve.x) > 0)
    assert curve.low.min() == values.min()
    assert curve.high.max() == values.max()
    assert np.all(curve.low <= curve.high)


def test_each_column_is_of_its_own_samples() -> None:
    curve = decimate(Channel(np.arange(1000.0), np.arange(1000.0)), 10)
    assert curve.low.tolist() == [100.0 * i for i in range(10)]
    assert curve.high.tolist() == [100.0 * i + 99.0 for i in range(10)]
    assert curve.x.tolist() == pytest.approx([100.0 * i + 49.5 for i in range(10)])


def test_a_band_is_where_most_curves_are() -> None:
    x = np.arange(5.0)
    curves = [
        Curve(x[:n], np.full(n, level), np.full(n, level + 1)) for n, level in ((5, 0.0), (3, 2.0), (3, 1.0))
    ]
    band = envelope(curves, x)
    assert band is not None
    assert band.low[:3].tolist() == [0.0] * 3
    assert band.high[:3].tolist() == [3.0] * 3
    assert np.isnan(band.low[3:]).all()
    assert envelope([], x) is None


def test_a_deviant_cycle_is_not_in_the_band_of_the_usual_ones() -> None:
    view = CellView("press-1")
    for number in range(1, 7):
        capture = make_capture(number)
        snapshot = make_snapshot(capture)
        if number == 4:
            odd = snapshot.signature
            odd = replace(odd, friction=odd.friction + 0.1, deviates_at_m=1e-3)
            snapshot = replace(snapshot, signature=odd)
        view.take(CellNews("press-1", snapshot, capture))
    detail = json.loads(view.encode("detail"))
    assert detail["usual_taps"] == 4
    assert max(detail["signature"]["usual_high"]) == pytest.approx(0.15)
    assert detail["deviant"]["cycle"] == 4


@pytest.mark.parametrize(
    ("other", "usual"),
    [
        ({"mass_kg": 6.0}, 3),
        ({"stroke_m": 2e-3}, 3),
        ({"direction": -1}, 3),
        ({"velocity_m_s": 0.02}, 3),
        ({"mass_kg": 18.95}, 6),
        ({"mass_kg": math.nan}, 3),
    ],
)
def test_a_band_is_of_taps_that_were_struck_alike(other: dict[str, float], usual: int) -> None:
    """Taps of 6 kg and of 38 kg made one band, which hid every tap."""
    view = CellView("press-1")
    for number in range(1, 8):
        capture = make_capture(number)
        if number % 2 == 0:
            capture = replace(capture, **other)
        view.take(CellNews("press-1", make_snapshot(capture), capture))
    assert json.loads(view.encode("detail"))["usual_taps"] == usual


def test_a_band_is_of_all_taps_where_no_mass_is_known() -> None:
    view = CellView("press-1")
    for number in range(1, 5):
        capture = replace(make_capture(number), mass_kg=math.nan)
        view.take(CellNews("press-1", make_snapshot(capture), capture))
    assert json.loads(view.encode("detail"))["usual_taps"] == 3
