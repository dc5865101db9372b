"""What a finding says at its end: what simulation shows, what is at rest, and a delay at its bound."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import (
    BaseModel,
    MachineFinding,
    NumberPrior,
    TermChoice,
    investigate_machine,
)
from impactcell.discrepancy.report import german_machine_sentences, machine_sentences
from impactcell.discrepancy.report.machine_result import machine_document
from impactcell.german.findings import german_headline
from impactcell.records import Capture, Channel

pytestmark = pytest.mark.slow

GRAVITY, NOISE = 29.4, 0.01
"""m g l over the inertia, 1/s², and the noise of a video's angles."""


@lru_cache
def filmed(
    viscous: float, *terms: str, seconds: float = 30.0, noise: float = NOISE, seed: int = 1
) -> MachineFinding:
    """A bob on a string, filmed at 30 frames a second, from 1 rad: by an integrator of its own."""
    time = np.arange(0.0, seconds, 1.0 / 30.0)
    run = solve_ivp(
        lambda _, state: (state[1], -GRAVITY * math.sin(state[0]) - viscous * state[1]),
        (0.0, seconds), (1.0, 0.0), t_eval=time, rtol=1e-9, atol=1e-11,
    )  # fmt: skip
    angle = run.y[0] + np.random.default_rng(seed).normal(0.0, noise, time.size)
    shot = Capture(1, math.nan, math.nan, None, Channel(time, angle))
    base = BaseModel(
        coordinate=Coordinate.ROTATION,
        inertia=NumberPrior(1.0),
        gravity_torque=NumberPrior(GRAVITY, math.inf),
        terms=tuple(map(TermChoice, terms)),
    )
    return investigate_machine(Campaign(Excitation.FREE_SLIDE, (shot,), coordinate=Coordinate.ROTATION), base)


def test_a_damping_that_only_the_simulation_shows_is_told() -> None:
    """Seven blocks are too few to fit, and in twelve seconds a quarter of the swing is gone."""
    finding = filmed(0.05, seconds=12.0)
    assert not finding.established
    better = finding.better_simulated
    assert better is not None
    assert {"viscous_friction", "quadratic_drag"} & {*better.names}
    assert better.rmse <= 0.5 * finding.simulated[-1].rmse
    assert finding.verdict == "untested"
    result = json.loads(json.dumps(machine_document(finding)))
    assert result["simulation"]["better_with"] == {
        "effects": list(better.names),
        "rmse": pytest.approx(better.rmse, rel=1e-3),
    }
    off = f"{better.rmse:.3g} rad off"
    assert off in result["headline"]
    [note] = [note for note in result["notes"] if f"put {better.names[0]} in the base model" in note]
    assert off in note
    assert "noise_std_rad" in note
    language, german = german_machine_sentences.note(note)
    assert language == "de"
    assert all(german_machine_sentences.phrase(name).lower() in german.lower() for name in better.names)
    numbers = f"{better.rmse:.3g} rad".replace(".", ",")
    for said in (german, german_machine_sentences.headline(finding), german_headline(result)):
        assert numbers in said
    assert machine_sentences.headline(finding) == result["headline"]


def test_a_damping_below_the_noise_is_told_by_its_strength() -> None:
    """The gap is at its floor, and friction of 0.02 is known to 40 %: not that nothing is missing."""
    finding = filmed(0.02, noise=0.02, seed=2)
    assert (finding.verdict, finding.established) == ("untested", ())
    assert finding.fall.after < 1.0
    strengths = {one.name: one for one in finding.clear_strengths}
    viscous = strengths["viscous_friction"]
    assert viscous.low < 0.02 < viscous.high < 2.5 * viscous.low
    result = json.loads(json.dumps(machine_document(finding)))
    assert result["remaining"]["hints"] == [*strengths]
    assert "is clear of 0" in result["headline"]
    first = finding.clear_strengths[0]
    [note] = [note for note in result["notes"] if "clear of 0 and not by chance" in note]
    assert f"{first.value:.3g} ({first.low:.3g} to {first.high:.3g}, SI)" in note
    assert not any("blocks do not show it" in note for note in result["notes"])
    language, german = german_machine_sentences.note(note)
    assert language == "de"
    for said in (german, german_machine_sentences.headline(finding), german_headline(result)):
        for name in strengths:
            assert german_machine_sentences.phrase(name).lower() in said.lower()


def test_of_a_film_without_damping_nothing_is_told() -> None:
    """What a swing of 12 s does not know of gravity any term may mend: simulated alone, one does."""
    for seed in range(3):
        finding = filmed(0.0, seed=seed)
        assert finding.verdict == "no_gap"
        assert finding.clear_strengths == ()


def test_where_the_base_model_has_it_none_is_told() -> None:
    finding = filmed(0.15, "viscous_friction")
    assert finding.better_simulated is None
    assert machine_document(finding)["simulation"]["better_with"] is None
    assert not any("in the base model and compare" in note for note in finding.notes)


def correlated(size: int, std: float, correlation: float, seed: int) -> np.ndarray:
    """Noise of first order: each sample has so much of the one before."""
    fresh = np.random.default_rng(seed).normal(0.0, std, size)
    fresh[1:] *= math.sqrt(1.0 - correlation**2)
    return np.asarray(lfilter([1.0], [1.0, -correlation], fresh))


def swinging(friction: float, noise: Callable[[int, int], np.ndarray], std: float | None) -> MachineFinding:
    """Four swings at 60 frames a second, and a base model of gravity alone."""
    time = np.arange(0.0, 25.0, 1.0 / 60.0)
    shots = []
    for number, release in enumerate((0.5, 0.9, 1.2, 0.8), 1):
        run = solve_ivp(
            lambda _, state: (state[1], -19.62 * math.sin(state[0]) - friction * math.tanh(state[1] / 1e-3)),
            (0.0, 25.0), (release, 0.0), t_eval=time, rtol=1e-8, atol=1e-10, max_step=0.01,
        )  # fmt: skip
        angle = run.y[0] + noise(time.size, number)
        shots.append(Capture(number, math.nan, math.nan, None, Channel(time, angle, std)))
    base = BaseModel(
        Coordinate.ROTATION, inertia=NumberPrior(1.0), gravity_torque=NumberPrior(19.6, math.inf)
    )
    campaign = Campaign(Excitation.FREE_SLIDE, tuple(shots), coordinate=Coordinate.ROTATION)
    return investigate_machine(campaign, replace(base, terms=()))


def wandering(finding: MachineFinding) -> list[str]:
    return [note for note in finding.notes if "noise that goes on from sample to sample" in note]


def test_noise_that_goes_on_from_sample_to_sample_is_told() -> None:
    """It was unknown without a word. Told by its density it is no gap."""
    std, correlation = 8e-3, 0.7

    def noise(size: int, seed: int) -> np.ndarray:
        return correlated(size, std, correlation, seed)

    finding = swinging(0.0, noise, None)
    assert finding.verdict == "unknown"
    [note] = wandering(finding)
    assert "state noise_std_rad in campaign.yaml" in note
    language, german = german_machine_sentences.note(note)
    assert language == "de"
    assert f"{finding.simulated[-1].rmse:.3g} rad".replace(".", ",") in german
    assert "noise_std_rad in campaign.yaml angeben" in german
    told = swinging(0.0, noise, std * math.sqrt((1.0 + correlation) / (1.0 - correlation)))
    assert told.verdict == "no_gap"
    assert not wandering(told)


def test_of_friction_that_is_missing_it_is_not_told() -> None:
    finding = swinging(0.12, lambda size, seed: np.random.default_rng(seed).normal(0.0, 8e-3, size), None)
    assert finding.established == ("coulomb_friction",)
    assert not wandering(finding)


def test_held_out_thirds_at_rest_are_told() -> None:
    """A swing that is over after half of the record, and a base model with another gravity."""
    time = np.arange(0.0, 9.0, 0.01)
    rng = np.random.default_rng(5)
    angle = 0.1 * np.exp(-0.6 * time) * np.cos(5.4 * time)
    shots = [
        Capture(number, math.nan, math.nan, None, Channel(time, read))
        for number, read in enumerate(angle + rng.normal(0.0, 1e-5, (2, time.size)), 1)
    ]
    base = BaseModel(
        coordinate=Coordinate.ROTATION, inertia=NumberPrior(0.02), gravity_torque=NumberPrior(0.3)
    )
    finding = investigate_machine(
        Campaign(Excitation.FREE_SLIDE, tuple(shots), coordinate=Coordinate.ROTATION), base
    )
    [note] = [note for note in finding.notes if "nearly at rest" in note]
    assert german_machine_sentences.note(note)[0] == "de"


@pytest.mark.parametrize(("std", "says"), [(0.002, True), (0.02, False)])
def test_a_delay_at_its_bound_is_told(std: float, says: bool) -> None:
    """1 kg that three sines drive, its force recorded 20 ms late."""
    time = np.arange(0.0, 20.0, 0.005)
    rates, phases = (2.0, 5.1, 9.7), (0.3, 1.9, 4.0)
    force = sum(np.sin(w * (time - 0.02) + at) for w, at in zip(rates, phases, strict=True))
    position = sum(-np.sin(w * time + at) / w**2 for w, at in zip(rates, phases, strict=True))
    rng = np.random.default_rng(6)
    channels = [
        Channel(time, values + rng.normal(0.0, noise, time.size), noise)
        for values, noise in ((force, 1e-2), (position, 1e-5))
    ]
    campaign = Campaign(Excitation.DRIVEN, (Capture(1, math.nan, 1.0, *channels),))
    base = BaseModel(inertia=NumberPrior(1.0), delay_s=NumberPrior(0.0, std))
    finding = investigate_machine(campaign, base)
    notes = [note for note in finding.notes if note.startswith("delay_s comes to rest")]
    assert bool(notes) is says
    assert all(german_machine_sentences.note(note)[0] == "de" for note in notes)
