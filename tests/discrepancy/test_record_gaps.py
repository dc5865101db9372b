"""Records of machines with gaps in time: nothing in them was measured, and no model is held to it."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from impactcell.campaign import Campaign
from impactcell.discrepancy.machine import BaseModel, NumberPrior, Response, investigate_machine
from impactcell.discrepancy.machine.records.fine_sampling import finely_sampled
from impactcell.discrepancy.machine.records.held_out_stretch import between_gaps
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord, uniform_records
from impactcell.errors import CampaignError
from impactcell.records import Capture
from tests.discrepancy.stick_slip import SLIDE, sines, slides

Gap = tuple[int, float, float]
"""Shot, begin [s], length [s]."""


@lru_cache
def whole() -> Campaign:
    return slides(lambda rng: sines(4.0, rng), (0.02, 1e-5), count=4)


def with_gaps(gaps: Sequence[Gap], channels: tuple[str, ...] = ("force", "position")) -> Campaign:
    """The same records without the samples of some stretches of time."""

    def cut(shot: Capture) -> Capture:
        kept = {}
        for name in channels:
            channel = getattr(shot, name)
            inside = np.ones(channel.time_s.size, dtype=bool)
            for number, begin_s, seconds in gaps:
                if number == shot.cycle:
                    inside &= (channel.time_s <= begin_s) | (channel.time_s >= begin_s + seconds)
            kept[name] = replace(channel, time_s=channel.time_s[inside], values=channel.values[inside])
        return replace(shot, **kept)

    return replace(whole(), shots=tuple(map(cut, whole().shots)))


EVERYWHERE = [(number, 0.7 + 1.9 * place, 0.25) for number in range(1, 5) for place in range(6)]


@pytest.mark.slow
@pytest.mark.parametrize("gaps", [[(2, 4.0, 0.25)], [(2, 9.5, 0.25)], [(2, 4.0, 0.05)], EVERYWHERE])
@pytest.mark.parametrize("response", Response)
def test_a_gap_is_no_gap_of_the_model(gaps: list[Gap], response: Response) -> None:
    """Bridged by a straight line it was one of 7 to 500 noise floors, in what fits or in what is held out."""
    finding = investigate_machine(with_gaps(gaps), replace(SLIDE, response=response))
    assert finding.verdict == "no_gap"
    assert max(*finding.train_gaps, finding.fall.after) < 1.3
    assert any("what happened meanwhile is lost" in note for note in finding.notes)
    assert not any("were replaced" in note for note in finding.notes)
    assert finding.simulated[-1].fit_percent > 80.0


@pytest.mark.slow
@pytest.mark.parametrize("channel", ["force", "position"])
def test_a_gap_of_one_channel_is_one_of_the_record(channel: str) -> None:
    base = replace(SLIDE, delay_s=NumberPrior(0.0, 5e-3))
    finding = investigate_machine(with_gaps(EVERYWHERE, (channel,)), base)
    assert finding.verdict == "no_gap"
    for record in finding.records:
        (low, high), *_ = record.gaps
        late = 0.01 if channel == "force" else 0.0  # two standard deviations of the delay to either side
        assert (low, high) == pytest.approx((0.7 - late, 0.952 + late), abs=0.005)


@pytest.mark.slow
def test_the_simulation_begins_anew_after_each_gap() -> None:
    finding = investigate_machine(with_gaps([(2, 10.6, 0.25)]), SLIDE)
    [before, after] = [(begin, end) for place, begin, end in finding.held_spans if place == 1]
    assert before[1] == pytest.approx(10.6, abs=5e-3)
    assert after[0] == pytest.approx(10.85, abs=5e-3)
    assert len([span for span in finding.held_spans if span[0] == 0]) == 1
    plain = investigate_machine(whole(), SLIDE)
    assert finding.simulated[-1].rmse < 1.5 * plain.simulated[-1].rmse


def test_records_that_are_cut_to_pieces_are_refused() -> None:
    gaps = [(number, 0.05 + 0.1 * place, 0.05) for number in range(1, 5) for place in range(119)]
    with pytest.raises(CampaignError, match="samples are missing or clipped so often that between the gaps"):
        investigate_machine(with_gaps(gaps), SLIDE)


def test_nothing_beside_a_gap_is_taken_for_an_outlier() -> None:
    """A motion that went on meanwhile looks like one."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        gaps = [
            (number, float(rng.uniform(0.5, 11.0)), float(rng.uniform(0.025, 0.4))) for number in range(1, 5)
        ]
        records = uniform_records(with_gaps(gaps), BaseModel(inertia=NumberPrior(2.0)))
        assert sum(record.spikes for record in records) == 0


def cut_record(gaps: tuple[tuple[float, float], ...], count: int = 100, step_s: float = 0.1) -> UniformRecord:
    time = step_s * np.arange(count)
    position = np.sin(time)
    return UniformRecord(1, "", time, position, 0.0 * time, 1.0, {}, 0, (1e-6, 0.0), gaps=gaps)


def test_samples_within_gaps_and_about_them() -> None:
    record = cut_record(((2.0, 2.5), (8.95, 9.05)))
    lost = [21, 22, 23, 24, 90]
    assert np.flatnonzero(~record.is_whole()).tolist() == lost
    assert np.flatnonzero(~record.is_whole(before=2, after=1)).tolist() == [*range(20, 27), *range(89, 93)]
    assert record.pieces() == [slice(0, 21), slice(25, 90), slice(91, 100)]
    assert record.longest_piece == slice(25, 90)
    assert record.part(25, 90).gaps == ()
    later = record.part(15)
    assert later.gaps == (pytest.approx((0.5, 1.0)), pytest.approx((7.45, 7.55)))
    assert np.flatnonzero(~later.is_whole()).tolist() == [place - 15 for place in lost]


def test_short_pieces_between_gaps_are_not_simulated_where_there_are_longer_ones() -> None:
    record = cut_record(((2.0, 2.5), (8.95, 9.05)))
    assert between_gaps(cut_record(()), 1.23, 9.9, 2.0) == [(1.23, 9.9)]
    pieces = between_gaps(record, 1.0, 9.9, 2.0)
    assert pieces == [pytest.approx((2.5, 8.9))]
    assert len(between_gaps(record, 1.0, 9.9, 0.5)) == 3
    assert between_gaps(record, 8.0, 9.9, 5.0) == [pytest.approx((8.0, 8.9))]


def test_records_made_finer_keep_their_gaps() -> None:
    """A low pass reaches 16 samples to either side, and its first value is 16 samples after the first."""
    step_s = 0.1
    time = step_s * np.arange(1200)
    values = np.sin(2.0 * math.pi * time / (5.0 * step_s))
    plain = UniformRecord(1, "", time, values, 0.0 * time, 1.0, {}, 0, (1e-6, 0.0))
    bridged = values.copy()
    bridged[1001:1031] = np.interp(time[1001:1031], time[[1000, 1031]], values[[1000, 1031]])
    gaps = ((float(time[1000]), float(time[1031])),)
    (finer, whole_one), _ = finely_sampled((replace(plain, position=bridged, gaps=gaps), plain))
    assert finer.finer == whole_one.finer > 1
    told = finer.is_whole()
    assert 0 < np.count_nonzero(~told) < 70 * finer.finer
    assert np.abs(finer.position - whole_one.position)[told].max() < 1e-9
