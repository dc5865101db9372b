"""Records of machines with a clipped channel: what it shows at the end of its range is nobody's model."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import BaseModel, NumberPrior, Response, investigate_machine
from impactcell.discrepancy.machine.records.record_notes import notes_of_records
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord, uniform_records
from impactcell.discrepancy.report.german_notes import note as german_note
from impactcell.records import Capture, Channel
from tests.discrepancy.stick_slip import SLIDE, sines, slides

KNOWN = BaseModel(inertia=NumberPrior(2.0))


@lru_cache
def whole() -> Campaign:
    return slides(lambda rng: sines(4.0, rng), (0.02, 1e-5), count=4)


def clipped(name: str, share: float) -> Campaign:
    """The same records, of which such a share stands at the ends of a channel's range, half at either."""

    def cut(shot: Capture) -> Capture:
        channel = getattr(shot, name)
        ends = np.quantile(channel.values, [0.5 * share, 1.0 - 0.5 * share])
        return replace(shot, **{name: replace(channel, values=np.clip(channel.values, *ends))})

    return replace(whole(), shots=tuple(map(cut, whole().shots)))


def at_ends(record: UniformRecord, name: str) -> np.ndarray:
    values = getattr(record, name)
    lost: np.ndarray = (values == values.max()) | (values == values.min())
    return lost


@pytest.mark.slow
@pytest.mark.parametrize("name", ["force", "position"])
@pytest.mark.parametrize("response", Response)
def test_what_is_clipped_is_no_gap_of_the_model(name: str, response: Response) -> None:
    """Taken for what was there, it was one of dozens to hundreds of noise floors."""
    finding = investigate_machine(clipped(name, 0.06), replace(SLIDE, response=response))
    assert finding.verdict == "no_gap"
    assert max(*finding.train_gaps, finding.fall.after) < 1.3
    assert finding.simulated[-1].fit_percent > 80.0
    [note] = [note for note in finding.notes if note.startswith("Clipped")]
    assert note.startswith("Clipped samples of 4 of 4 records are left out: ")
    assert german_note(note)[1].startswith("Begrenzte Messwerte sind in 4 von 4 Messungen ausgelassen: ")
    assert not any("were replaced" in note for note in finding.notes)
    for place, begin_s, end_s in finding.held_spans:
        record = finding.records[place]
        inside = (record.time_s >= begin_s) & (record.time_s <= end_s)
        assert not np.any(at_ends(record, name) & inside)


@pytest.mark.parametrize("name", ["force", "position"])
def test_clipped_samples_lie_in_gaps_and_no_others(name: str) -> None:
    records = uniform_records(clipped(name, 0.06), KNOWN)
    for record in records:
        ends = np.count_nonzero(at_ends(record, name))
        # Noise brings a few samples off the end amid ones that stand there.
        assert ends <= record.clipped < 1.1 * ends
        assert not np.any(record.is_whole() & at_ends(record, name))
        # And one sound sample between two gaps is none that stands alone.
        assert record.clipped <= np.count_nonzero(~record.is_whole()) < 1.1 * ends
    assert all(not record.gaps and not record.clipped for record in uniform_records(whole(), KNOWN))


def test_a_record_that_begins_and_ends_clipped_has_its_gaps_there() -> None:
    time = 0.01 * np.arange(1000)
    rng = np.random.default_rng(1)
    position = np.cos(4.0 * math.pi * time / 9.99) + rng.normal(0.0, 1e-4, time.size)
    force = rng.normal(0.0, 1.0, time.size)
    cut = np.minimum(position, 0.9)
    shot = Capture(1, math.nan, 2.0, Channel(time, force, 0.1), Channel(time, cut, 1e-4))
    [record] = uniform_records(Campaign(Excitation.DRIVEN, (shot,)), BaseModel())
    assert (record.gaps[0][0], record.gaps[-1][1]) == (pytest.approx(-0.01), pytest.approx(10.0))
    assert not record.is_whole()[position > 0.901].any()
    assert record.is_whole()[position < 0.89].all()


def test_a_force_that_is_at_its_limit_most_of_the_time_is_what_drives() -> None:
    records = uniform_records(clipped("force", 0.4), KNOWN)
    assert all(record.at_limit and not record.clipped and not record.gaps for record in records)
    [note] = [note for note in notes_of_records(KNOWN, records) if "were replaced" not in note]
    assert note.startswith("In 4 of 4 records the force stands at an end of its range for more than 25 % ")
    assert german_note(note)[1].startswith("In 4 von 4 Messungen steht die Kraft mehr als 25 % der Zeit an ")


def test_levels_of_a_command_are_no_ends_of_a_range() -> None:
    time = 0.001 * np.arange(6000)
    levels = 5.0 * np.random.default_rng(2).integers(-2, 3, 60)
    position = np.sin(time) + np.random.default_rng(3).normal(0.0, 1e-4, time.size)
    channels = Channel(time, np.repeat(levels, 100), None), Channel(time, position, 1e-4)
    shot = Capture(1, math.nan, 2.0, *channels)
    [record] = uniform_records(Campaign(Excitation.DRIVEN, (shot,)), BaseModel())
    assert record.force_is_command
    assert (record.clipped, record.at_limit, record.gaps) == (0, False, ())
