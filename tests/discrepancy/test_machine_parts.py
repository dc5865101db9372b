"""Parts of a machine's fits by themselves: what is left, its range, spikes and correlations."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import NumberPrior, OpenLoopError, investigation
from impactcell.discrepancy.machine import finding as machine_finding
from impactcell.discrepancy.machine.finding import Remainder
from impactcell.discrepancy.machine.fits import proof
from impactcell.discrepancy.machine.fits.remainder import remainder_of
from impactcell.discrepancy.machine.records import channel_values
from impactcell.discrepancy.machine.records.record_notes import notes_of_records
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.machine.regression.block_sums import blocks_of
from impactcell.discrepancy.machine.regression.trials import TermSearch
from impactcell.discrepancy.machine.regression.weak_form import Rows
from impactcell.discrepancy.machine.simulation import held_out as simulation
from impactcell.discrepancy.machine.terms.base_model import BaseModel, Response
from impactcell.discrepancy.machine.terms.rival_forms import hats
from impactcell.discrepancy.report.simulation_notes import notes_of_simulation
from impactcell.errors import CampaignError
from impactcell.records import Capture, Channel


def test_range_of_a_gap_where_nothing_is_left_is_students() -> None:
    """Noise of one and five blocks' squares about it: t with four degrees of freedom, 2.776 of an error."""
    squares = np.array([0.8, 1.3, 0.9, 1.1, 0.9])
    model: Any = SimpleNamespace(fit=SimpleNamespace(columns=(), coefficients=np.empty(0)))

    def blocks(values: np.ndarray) -> Any:
        return SimpleNamespace(
            losses=lambda *_: 2.0 * values, noise=np.full(len(values), 2.0), largest_by_chance=1.3
        )

    half = 2.776445 * squares.std(ddof=1) / squares.mean() / math.sqrt(5.0)
    expected = math.sqrt(1.0 - half) / 1.05, math.sqrt(1.0 + half) * 1.05
    assert proof.expected_gap(blocks(squares), model) == pytest.approx(expected, rel=1e-6)
    lowest, highest = proof.expected_gap(blocks(squares[:1]), model)
    assert lowest == 0.0 < 1.0 < highest
    assert proof.expected_gap(blocks(np.array([1e-3, 4.0])), model)[0] == 0.0


@pytest.mark.parametrize(
    ("after", "training", "expected"), [(1.0, 1.0, True), (2.0, 1.0, False), (1.0, 2.0, False)]
)
def test_a_model_is_at_the_floor_where_it_was_fitted_and_where_not(
    after: float, training: float, expected: bool
) -> None:
    found: Any = SimpleNamespace(
        fall=SimpleNamespace(after=after),
        expected=(0.9, 1.1),
        train_gaps=(3.0, training),
        training=SimpleNamespace(largest_by_chance=1.3),
    )
    assert machine_finding.MachineFinding.is_at_floor.fget(found) is expected  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("moving", "pattern", "said"),
    [
        (
            (1, 2, 4, 5),
            "[36]",
            r"what is held out \(shots 3, 6\) moves too little for a block of 1 s: hold other",
        ),
        (
            (3, 6),
            "[36]",
            r"what is fitted \(shots 1, 2, 4, 5\) moves too little for a block of 1 s: hold other",
        ),
        ((), None, r"what is held out \(the last third of each record\) moves too little for a block of 1 s"),
    ],
)
def test_records_that_move_too_little_are_told_from_short_ones(
    moving: tuple[int, ...], pattern: str | None, said: str
) -> None:
    """Records of 10 s were told to be too short for blocks of 1 s."""
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 10.0, 5e-3)
    shots = []
    for number in range(1, 7):
        clock = time if number in moving else np.minimum(time, 0.0 if moving else 1.5)
        channel = Channel(time, 0.01 * np.sin(6.0 * clock) + rng.normal(0.0, 1e-6, time.size), 1e-6)
        force = Channel(time, np.sin(6.0 * time) + rng.normal(0.0, 1e-3, time.size), 1e-3)
        shots.append(Capture(number, math.nan, 1.0, force, channel))
    base = BaseModel(inertia=NumberPrior(1.0), block_s=1.0)
    with pytest.raises(CampaignError, match=said):
        investigation.investigate_machine(Campaign(Excitation.DRIVEN, tuple(shots)), base, test=pattern)
    with pytest.raises(CampaignError, match=r"too short for blocks of 11 s|too short for blocks of 4 s"):
        investigation.investigate_machine(
            Campaign(Excitation.DRIVEN, tuple(shots)),
            replace(base, block_s=11.0 if pattern else 4.0),
            test=pattern,
        )


def test_spikes_are_taken_out_of_a_signal_far_from_nought() -> None:
    values = 100.0 + np.sin(np.linspace(0.0, 6.0, 600))
    spoilt = values.copy()
    spoilt[[150, 400]] += [30.0, -25.0]
    clean, spikes = channel_values.without_spikes(spoilt)
    assert spikes == 2
    assert clean == pytest.approx(values, abs=0.02)


def test_a_spike_is_replaced_by_the_line_between_its_neighbours() -> None:
    values = np.linspace(0.0, 5.99, 600)
    spoilt = values.copy()
    spoilt[[0, 150, 151, 400]] += [30.0, 30.0, 28.0, -25.0]
    clean, spikes = channel_values.without_spikes(spoilt)
    assert spikes == 4
    assert clean == pytest.approx(values, abs=1e-12)


@pytest.mark.parametrize(("drive", "samples"), [(0.0, 600), (1.0, 1200)])
def test_spikes_are_told_of_the_samples_that_there_are(drive: float, samples: int) -> None:
    """A part without a drive has no force that was looked through."""
    time = np.linspace(0.0, 6.0, 600)
    spoilt = np.sin(time)
    spoilt[200] += 3.0
    force = Channel(time, drive * np.cos(time) + np.random.default_rng(2).normal(0.0, 1e-3, 600))
    shot = Capture(1, math.nan, 1.0, force if drive else None, Channel(time, spoilt))
    base = BaseModel(inertia=NumberPrior(1.0))
    records = uniform_records(Campaign(Excitation.DRIVEN, (shot,)), base)
    assert notes_of_records(base, records)[0].startswith(f"1 of {samples} samples stood far")


def test_a_push_of_some_samples_is_no_spike() -> None:
    values = np.random.default_rng(3).normal(0.0, 1.0, 6000)
    for place, height in enumerate((60.0, 55.0, 43.0, 23.0)):
        values[300 + place :: 500] += height
    clean, spikes = channel_values.without_spikes(values)
    assert spikes == 0
    assert (clean == values).all()


def test_the_correlation_time_is_that_which_went_in() -> None:
    """White noise averaged over m steps has the correlations 1 - l / m: their sum is (m + 1) / 2 steps."""
    rng, m, step = np.random.default_rng(2), 12, 0.01
    averaged = np.array([np.convolve(rng.normal(size=3000), np.ones(m), "valid") for _ in range(2)])
    rows = SimpleNamespace(
        target=averaged.ravel(), columns={}, record=np.repeat([0, 1], averaged.shape[1]),
        time_s=np.tile(step * np.arange(averaged.shape[1]), 2), variance=np.zeros(averaged.size),
    )  # fmt: skip
    assert left_of(rows, shots=(1, 2)).correlation_s == pytest.approx(0.5 * (m + 1) * step, rel=0.3)


def left_of(rows: object, shots: tuple[int, ...]) -> Remainder:
    """What a model without any term leaves."""
    model: Any = SimpleNamespace(fit=SimpleNamespace(columns=(), coefficients=()))
    records: Any = tuple(SimpleNamespace(shot=shot) for shot in shots)
    return remainder_of(rows, model, records)  # type: ignore[arg-type]


def ringing(sizes: tuple[float, ...], constants: tuple[float, ...]) -> SimpleNamespace:
    """A wave of each record's own size about its own constant, 100 rows of noise 1 each."""
    wave = math.sqrt(2.0) * np.sin(2.0 * np.pi * np.arange(100) / 20.0)
    parts = [size * wave + constant for size, constant in zip(sizes, constants, strict=True)]
    return SimpleNamespace(
        target=np.concatenate(parts), columns={}, record=np.repeat(np.arange(len(sizes)), 100),
        time_s=np.tile(0.01 * np.arange(100), len(sizes)), variance=np.ones(100 * len(sizes)),
    )  # fmt: skip


def test_the_few_records_in_which_most_is_left_are_told() -> None:
    left = left_of(ringing((2.0, 2.0, 6.0, 2.0, 2.0, 5.0), (0.0,) * 6), shots=(11, 12, 13, 14, 15, 16))
    assert left.shots == (13, 16)
    assert left.share == pytest.approx((35.0 + 24.0) / (35.0 + 24.0 + 4 * 3.0))
    assert left.constant_share == pytest.approx(0.0, abs=1e-12)


def test_no_record_is_told_where_all_leave_as_much() -> None:
    left = left_of(ringing((2.0,) * 6, (0.0,) * 6), shots=(1, 2, 3, 4, 5, 6))
    assert (left.shots, left.share) == ((), 0.0)


def test_what_is_a_constant_of_each_record_is_told_as_such() -> None:
    """Of mean squares 1 + c² less the noise of 1, c² is the constant's."""
    left = left_of(ringing((1.0,) * 4, (3.0, -3.0, 3.0, -3.0)), shots=(1, 2, 3, 4))
    assert left.constant_share == pytest.approx(1.0)
    left = left_of(ringing((math.sqrt(10.0),) * 4, (3.0, -3.0, 3.0, -3.0)), shots=(1, 2, 3, 4))
    assert left.constant_share == pytest.approx(0.5)


def test_held_out_stretches_are_simulated_from_begin_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    record = SimpleNamespace(time_s=0.1 * np.arange(100), position=np.sin(np.arange(100.0)))
    stretches: list[slice] = []

    def exact(_model: object, parts: Any, _period: float) -> list[np.ndarray]:
        stretches.extend(stretch for _, stretch in parts)
        return [part.position[stretch] for part, stretch in parts]

    monkeypatch.setattr(simulation, "_positions", exact)
    found: Any = SimpleNamespace(
        held_spans=[(0, 2.0, 3.0), (0, 7.0, 9.9)], records=[record], scale=SimpleNamespace(period_s=1.0)
    )
    response = next(kind for kind in Response if kind is not Response.FORCE)
    model: Any = SimpleNamespace(base=BaseModel(response=response))
    error = simulation.simulate_held_out(found, model)
    times = [record.time_s[stretch] for stretch in stretches]
    assert [(part[0], part[-1]) for part in times] == [
        (pytest.approx(2.0), pytest.approx(3.0)),
        (pytest.approx(7.0), pytest.approx(9.9)),
    ]
    assert (error.rmse, error.fit_percent) == (0.0, 100.0)


@pytest.mark.parametrize(
    ("established", "rmse", "said"),
    [
        (("viscous_friction",), (8e-3, 1.3e-2), True),
        (("viscous_friction",), (8e-3, 5e-3), False),
        ((), (8e-3, 8e-3), False),
    ],
)
def test_a_simulation_that_errs_more_with_a_named_term_is_told(
    established: tuple[str, ...], rmse: tuple[float, float], said: bool
) -> None:
    base = BaseModel(response=Response.POSITION, coordinate=Coordinate.TRANSLATION)
    found: Any = SimpleNamespace(established=established, base=base)
    errors: Any = tuple(OpenLoopError(error, 50.0, math.nan) for error in rmse)
    notes = notes_of_simulation(found, errors)
    assert len(notes) == said
    assert all("0.013 m off with it, 0.008 without" in note for note in notes)


def test_a_free_form_goes_on_straight_where_one_record_alone_has_been() -> None:
    """Speeds of the first record are twice those of the others, which its corners hardly see."""
    rng = np.random.default_rng(5)
    record = np.arange(1200) // 240
    speed = rng.uniform(0.0, 1.0, 1200) * np.where(record == 0, 2.0, 1.02)
    columns = {("friction_over_speed", 0.0, i): row for i, row in enumerate(hats(speed, 0.0, 2.0))}
    target = 3.0 * speed + 0.5 * speed**2 + rng.normal(size=1200)
    nothing = np.zeros(1200)
    rows = Rows(target, columns, record, np.arange(1200.0), np.ones(1200), nothing)
    number = np.arange(1200) // 40
    blocks = blocks_of(rows, number, {int(block): int(record[40 * block]) for block in np.unique(number)})
    search = TermSearch(blocks, (), {}, {}, frozenset())
    before, noise = search.losses([]), float(blocks.noise.sum())
    free = search.free_losses([], "friction_over_speed")
    assert free.sum() < 1.5 * noise < 6.0 * noise < before.sum()
    assert search.losses([*columns]).sum() > 3.0 * free.sum()  # without a penalty
