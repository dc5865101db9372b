"""Drives that are held from update to update: switched to and fro, at random levels, slower than the log."""

import math
import re
from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import BaseModel, MachineFinding, NumberPrior, investigate_machine
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.machine.regression.block_sums import LinearFit
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.regression.weak_form import build_rows
from impactcell.discrepancy.machine.simulation.experiment_design import _changes
from impactcell.discrepancy.machine.simulation.held_out import simulate_held_out
from impactcell.discrepancy.report.german_notes import note as german_note
from impactcell.discrepancy.report.machine_result import machine_document
from impactcell.features import drive_noise_std
from impactcell.records import Capture, Channel
from tests.discrepancy.machine_study import establish_in

RATE_HZ = 150.0
MASS_KG, FRICTION_N, VISCOUS, DRIVE_N = 6.3, 2.0, 14.0, 13.0
"""Of a cart that a motor pulls to and fro about a place, full force one way and then the other; SI."""
SUBSTEPS = 10
"""Of an integration from sample to sample: friction turns from -1 to 1 mm/s, which takes a millisecond."""
CART = BaseModel(inertia=NumberPrior(6.0, math.inf), force_offset=NumberPrior(0.0, 3.0))


def ahead(place: np.ndarray, speed: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give where carts are a sample later, and how fast, by classical steps of Runge and Kutta."""
    step_s = 1.0 / RATE_HZ / SUBSTEPS

    def rate(speed: np.ndarray) -> np.ndarray:
        return (force - FRICTION_N * np.tanh(speed / 1e-3) - VISCOUS * speed) / MASS_KG

    for _ in range(SUBSTEPS):
        first = rate(speed)
        second = rate(speed + 0.5 * step_s * first)
        third = rate(speed + 0.5 * step_s * second)
        fourth = rate(speed + step_s * third)
        place = place + step_s * speed + step_s**2 / 6.0 * (first + second + third)
        speed = speed + step_s / 6.0 * (first + 2.0 * (second + third) + fourth)
    return place, speed


@lru_cache
def cart(late: int, seconds: float = 8.0) -> tuple[Capture, ...]:
    """Records about nine places, integrated otherwise than by the workflow.

    The command is logged `late` samples before it acts.
    """
    places = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.65, 0.7, 0.72])
    draws = [np.random.default_rng([11, number]) for number in range(1, places.size + 1)]
    time = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    command, position = np.empty((2, time.size, places.size))
    place, speed = places - [0.004 * rng.random() for rng in draws], np.zeros(places.size)
    force, waiting = np.full(places.size, DRIVE_N), np.zeros(places.size, dtype=int)
    for sample in range(time.size):
        position[sample], command[sample] = place, force
        # To the middle, with some samples of delay, so that it swings a centimetre to either side.
        wanted = np.where(place + 0.03 * speed > places, -DRIVE_N, DRIVE_N)
        waiting = np.where(wanted != force, waiting + 1, 0)
        place, speed = ahead(place, speed, command[max(sample - late, 0)])
        switched = waiting > [2 + int(rng.integers(3)) for rng in draws]
        force, waiting = np.where(switched, wanted, force), np.where(switched, 0, waiting)
    read = 4.4e-5 * np.round(position / 4.4e-5)
    return tuple(
        Capture(number, math.nan, math.nan, Channel(time, driven, None), Channel(time, moved, None))
        for number, (driven, moved) in enumerate(zip(command.T.copy(), read.T.copy(), strict=True), 1)
    )


@lru_cache
def found() -> MachineFinding:
    """What is established with short records whose command acts at once."""
    return establish_in(Campaign(Excitation.DRIVEN, cart(0, 3.0)), CART)


@pytest.mark.slow
def test_the_steps_of_a_switched_drive_are_no_noise_and_act_until_the_next() -> None:
    finding = investigate_machine(Campaign(Excitation.DRIVEN, cart(0)), CART)
    result = machine_document(finding)
    assert result["noise_floor"]["noise_std"][0] == 0.0
    assert (finding.verdict, finding.established) == ("named", ("viscous_friction",))
    viscous = result["effects"][0]["parameters"]["viscous_coefficient_n_s_per_m"]["value"]
    assert viscous == pytest.approx(VISCOUS, rel=0.1)
    assert result["nominal"]["inertia"]["value"] == pytest.approx(MASS_KG, rel=0.01)
    [note] = [note for note in finding.notes if "taken for a command" in note]
    assert note.startswith("The force is held from one update to the next in 9 of 9 records")
    language, german = german_note(note)
    assert language == "de"
    assert german.startswith(
        "Die Kraft wird in 9 von 9 Messungen von einem Wert zum nächsten gehalten: Sie gilt"
    )
    assert not any("would explain" in note for note in finding.notes)
    assert not any("were replaced" in note for note in finding.notes)


def test_where_a_stretch_lies_is_no_motion_that_a_model_predicts() -> None:
    """Places are half a metre apart, the motion about each is a centimetre."""
    finding = found()
    error = finding.simulated[0]
    held = [finding.records[place].position for place, _, _ in finding.held_spans]
    varying = np.concatenate([position - position.mean() for position in held])
    assert error.fit_percent == pytest.approx(100.0 * (1.0 - error.rmse / varying.std()), abs=1.0)
    assert finding.simulated[-1].rmse < error.rmse


@pytest.mark.slow
def test_a_command_that_is_logged_early_is_asked_after_and_found_with_what_is_missing() -> None:
    """By a sample, as by a motor's inductance: a negative delay, to a fiftieth of a sample."""
    campaign = Campaign(Excitation.DRIVEN, cart(1))
    unasked = establish_in(campaign, CART)
    assert unasked.verdict == "unknown"
    [note] = [note for note in unasked.notes if "would explain" in note]
    assert re.match(r"A force recorded [5-8]\.\d ms early would explain 9\d % of what remains: delay_s", note)
    assert re.match(r"Eine um [5-8],\d ms zu früh aufgezeichnete Kraft erklärte 9\d %", german_note(note)[1])
    finding = investigate_machine(campaign, replace(CART, delay_s=NumberPrior(0.0, 0.02)))
    assert finding.established == ("viscous_friction",)
    delay = machine_document(finding)["nominal"]["delay_s"]
    assert finding.final.delay_s == pytest.approx(-1.0 / RATE_HZ, abs=0.02 / RATE_HZ)
    assert delay["ci95"][0] < delay["value"] < delay["ci95"][1]
    assert not any("would explain" in note for note in finding.notes)


@pytest.mark.slow
def test_a_delay_goes_no_further_than_its_prior_allows() -> None:
    campaign = Campaign(Excitation.DRIVEN, cart(1))
    finding = establish_in(campaign, replace(CART, delay_s=NumberPrior(0.0, 0.001)))
    assert finding.nominal.delay_s == pytest.approx(-0.002)
    assert machine_document(finding)["nominal"]["delay_s"]["at_bound"]


@pytest.mark.slow
def test_nothing_remains_below_a_noise_that_is_stated_too_large() -> None:
    loud = tuple(
        replace(shot, force=replace(shot.force, noise_std=1e4)) for shot in cart(0)[:3] if shot.force
    )
    finding = investigate_machine(Campaign(Excitation.DRIVEN, loud), CART)
    assert (finding.remainder.share, finding.remainder.constant_share) == (0.0, 0.0)


def test_a_slow_command_acts_until_the_next_one() -> None:
    """A drive of another rate than the position: its impulse from sample to sample is what was given."""
    times = np.cumsum(np.full(40, 0.05))
    levels = np.repeat([5.0, -3.0, 5.0, 2.0], 10)
    at = np.arange(times[0], times[-1], 0.004)
    shot = Capture(1, math.nan, 1.0, Channel(times, levels, None), Channel(at, np.sin(at), None))
    [record] = uniform_records(Campaign(Excitation.DRIVEN, (shot,)), BaseModel())
    exact = levels[np.searchsorted(times, at - 1e-9, side="right") - 1]
    assert record.force_is_command
    assert np.abs(record.force[1:-1] - exact[1:-1]).max() <= 8.0
    assert np.count_nonzero(np.abs(record.force - exact) > 1e-9) <= 8
    assert record.force.sum() == pytest.approx(exact.sum(), abs=8.0)


def _pulled(until_s: float, levels: np.ndarray, level_s: float, delay_s: float) -> float:
    """Place of a mass with dry friction at a time, by the parabolas of each level, which acts late."""
    place, speed, now = 0.0, 0.0, 0.0
    while now < until_s:
        number = math.floor((now + delay_s) / level_s + 1e-9)
        force = float(levels[min(max(number, 0), len(levels) - 1)])
        end = min((number + 1) * level_s - delay_s, until_s)
        sense = math.copysign(1.0, speed or force)
        rate = (force - sense * FRICTION_N) / MASS_KG
        if speed == 0.0 and abs(force) <= FRICTION_N:
            now = end
            continue
        stop = now - speed / rate if speed * rate < 0.0 else math.inf
        last = min(end, stop)
        place += speed * (last - now) + 0.5 * rate * (last - now) ** 2
        speed = 0.0 if last == stop else speed + rate * (last - now)
        now = last
    return place


@pytest.mark.parametrize("delay_s", [0.0, 0.0037, -0.0071])
def test_a_command_is_simulated_as_it_acts(delay_s: float) -> None:
    """Levels of half a second, far slower than the samples: parabolas from switch to switch and stop."""
    step_s, level_s = 0.01, 0.5
    levels = np.random.default_rng(4).uniform(-6.0, 6.0, 40)
    time = step_s * np.arange(2000)
    position = np.array([_pulled(at, levels, level_s, delay_s) for at in time])
    command = np.repeat(levels, 50)
    shot = Capture(1, math.nan, MASS_KG, Channel(time, command, None), Channel(time, position, 1e-6))
    base = BaseModel(inertia=NumberPrior(MASS_KG))
    records = uniform_records(Campaign(Excitation.DRIVEN, (shot,)), base)
    friction = ChosenTerm(base.terms[0], 0.0)
    values = np.array([FRICTION_N])
    fit = LinearFit(friction.columns, values, values, values, np.array([False]))
    finding: Any = SimpleNamespace(
        held_spans=[(0, 0.0, time[-1])], records=records, scale=SimpleNamespace(period_s=4.0)
    )
    error = simulate_held_out(finding, FittedModel(base, (friction,), fit, delay_s, 0.0))
    assert np.ptp(position) > 0.5
    assert error.rmse < 2e-3 * np.ptp(position)


@pytest.mark.parametrize("delay_s", [0.0, 0.0037, -0.0071])
def test_rows_are_exact_where_a_command_switches(delay_s: float) -> None:
    """A mass without friction: speeds are lines and places parabolas from switch to switch."""
    step_s, level_s = 0.01, 0.07
    levels = np.random.default_rng(5).uniform(-6.0, 6.0, 60)
    edges = np.concatenate([[-1.0], level_s * np.arange(1, 60) - delay_s, [9.0]])
    speeds = np.concatenate([[0.0], np.cumsum(np.diff(edges) * levels)]) / MASS_KG
    places = np.concatenate([[0.0], np.cumsum(np.diff(edges) * 0.5 * (speeds[1:] + speeds[:-1]))])
    time = step_s * np.arange(420)
    inside = np.searchsorted(edges, time, "right") - 1
    after = time - edges[inside]
    position = places[inside] + after * (speeds[inside] + 0.5 * after * levels[inside] / MASS_KG)
    command = np.repeat(levels, 7)
    shot = Capture(1, math.nan, MASS_KG, Channel(time, command, None), Channel(time, position, 1e-6))
    base = BaseModel(inertia=NumberPrior(MASS_KG), terms=(), delay_s=NumberPrior(delay_s))
    records = uniform_records(Campaign(Excitation.DRIVEN, (shot,)), base)
    rows = build_rows(records, base, {}, (0.0, delay_s))
    assert len(rows.target) > 10
    assert np.abs(rows.target).max() < 1e-9 * DRIVE_N


def test_a_command_that_is_driven_harder_acts_until_the_next_one_too() -> None:
    record = uniform_records(Campaign(Excitation.DRIVEN, cart(0)[:1]), CART)[0]
    [harder] = [one for one in _changes(found(), record) if one.words.endswith("its drive 2 times as strong")]
    assert harder.records[0].command == pytest.approx(2.0 * record.command)
    part = record.part(100, 200)
    assert record.command is not None
    assert part.command is not None
    assert part.command.tolist() == record.command[100:200].tolist()


@pytest.mark.parametrize("held", [2, 5, 20])
def test_noise_of_a_measured_drive_that_is_held(held: int) -> None:
    rng = np.random.default_rng(1)
    slow = 10.0 * np.sin(2.0 * math.pi * np.arange(1000) / 200.0) + rng.normal(0.0, 0.05, 1000)
    assert drive_noise_std(np.repeat(slow, held)) == pytest.approx(0.05 * math.sqrt(held), rel=0.15)


def test_levels_that_are_chosen_one_by_one_are_a_command() -> None:
    rng = np.random.default_rng(2)
    random_levels = np.repeat(rng.uniform(-5.0, 5.0, 300), rng.integers(5, 40, 300))
    switched = np.repeat(rng.choice([-1.0, 0.0, 1.0], 200), rng.integers(4, 30, 200))
    assert drive_noise_std(random_levels) == 0.0
    assert drive_noise_std(switched) == 0.0


@pytest.mark.parametrize("std", [0.02, 1.0])
def test_noise_of_a_drive_that_is_not_held(std: float) -> None:
    """Fine or on a coarse raster, which a slow signal crosses step by step."""
    rng = np.random.default_rng(3)
    slow = 10.0 * np.sin(2.0 * math.pi * np.arange(6000) / 3000.0)
    noisy = slow + rng.normal(0.0, std, slow.size)
    assert drive_noise_std(noisy) == pytest.approx(std, rel=0.1)
    coarse = 0.5 * np.round(slow / 0.5)
    assert drive_noise_std(coarse) >= 0.9 * 0.5 / math.sqrt(12.0)
