"""The plant of a campaign: found from the simulator's taps, with and without a law that the model lacks."""

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import null_space
from scipy.stats import multivariate_normal

from impactcell.campaign import Excitation, from_contact
from impactcell.campaign.recorded_campaign import from_captures
from impactcell.errors import PredictionError
from impactcell.features import Features, extract, required
from impactcell.features.contact import contact_spells
from impactcell.physics import Plant
from impactcell.prediction import Model, Prior, estimate_from_features, printed_predictor
from impactcell.prediction.joint_plant_fit import contact_constants, estimate_mass, fit_plant, ratio_scatter
from impactcell.records import Capture, Channel, Quality, Samples, as_recorded
from tests.taps import Tap

DRAG = {"quadratic_drag": {"drag_coefficient_n_s2_per_m2": 45.0}}


def printed_model() -> Model:
    plant = Plant(6.5e5, 465.0, 0.2, 0.152)
    return Model("printed", plant, Prior(6500.0, 9.3, 0.0228), (printed_predictor(),))


def campaign(seed: int, effects: dict[str, dict[str, float]]) -> list[Capture]:
    rng = np.random.default_rng(seed)
    taps = [
        Tap(
            velocity / 6e4, 0.21 * (1 + 0.012 * rng.normal()), 0.8, mass, 1.5e-3, sign,
            stiffness=7.1e5, damping=520.0, effects=effects,
        )
        for velocity in (2000, 3000, 4500, 6000)
        for mass in (18.9, 25.2)
        for sign in (1, -1)
    ]  # fmt: skip
    return [tap.capture(rng, cycle=number) for number, tap in enumerate(taps, 1)]


def test_the_plant_is_found_within_its_error() -> None:
    found = fit_plant([extract(tap) for tap in campaign(1, {})], 9.81)
    plant, prior = found.model.plant, found.model.prior
    assert found.used == tuple(range(1, 17))
    assert 0.95 < found.gap < 1.05
    assert abs(plant.stiffness_n_per_m - 7.1e5) < 4.0 * prior.stiffness_std_n_per_m
    assert abs(plant.damping_n_s_per_m - 520.0) < 4.0 * prior.damping_std_n_s_per_m
    assert abs(found.model.ratio - 0.8) < 4.0 * prior.ratio_std
    assert prior.stiffness_std_n_per_m < 1e-3 * plant.stiffness_n_per_m
    assert plant.effects == {}


def test_contact_between_two_samples_is_found() -> None:
    """Taps that a recorder with a trigger of its own puts half a step late had no plant, or a wrong one."""

    def late(tap: Capture, by_s: float) -> Features:
        force, position = tap.force, tap.position
        assert force is not None
        assert position is not None
        moved = replace(
            tap,
            force=replace(force, time_s=force.time_s + by_s),
            position=replace(position, time_s=position.time_s + by_s),
            onset_std_s=5e-5,
        )
        return extract(moved)

    taps = campaign(5, {})[::2]
    for by_s in (4e-5, 0.0):
        found = fit_plant([late(tap, by_s) for tap in taps], 9.81)
        assert found.onset_s == pytest.approx(by_s, abs=1e-6)
        assert found.gap < 1.1
        assert found.model.plant.stiffness_n_per_m == pytest.approx(7.1e5, rel=1e-3)
        assert found.model.plant.damping_n_s_per_m == pytest.approx(520.0, rel=3e-3)


def test_taps_whose_contact_lies_anywhere_in_a_step_have_their_friction() -> None:
    """Each has a moment of its own: with one for all of them mu_s was off by up to 60 %, status good."""
    rng = np.random.default_rng(8)
    taps, frictions = [], rng.uniform(0.15, 0.25, 20)
    for cycle, mu_s in enumerate(frictions, 1):
        velocity, mass_kg = float(rng.uniform(0.03, 0.09)), float(rng.choice([10.0, 18.9, 30.0]))
        taps.append(
            with_pretrigger(Tap(velocity, mu_s, mass_kg=mass_kg, stroke_m=2e-3, effects={}), rng, cycle)
        )
    counted, _ = from_contact(from_captures(taps, 9.81).campaign)
    assert counted.excitation is Excitation.TAP
    features = [extract(tap) for tap in counted.shots]
    found = fit_plant(features, 9.81)
    assert found.gap < 1.05
    assert found.model.plant.stiffness_n_per_m == pytest.approx(6.5e5, rel=1e-3)
    assert found.model.ratio == pytest.approx(0.76, rel=0.01)
    said = [found.estimate(tap, found.model).mu_s for tap in features]
    off = np.array([one.value / mu_s - 1.0 for one, mu_s in zip(said, frictions, strict=True)])
    pulls = off * frictions / np.array([one.std for one in said])
    assert np.abs(off).max() < 0.01
    assert float(np.sqrt(np.mean(pulls**2))) < 1.5


def with_pretrigger(tap: Tap, rng: np.random.Generator, cycle: int) -> Capture:
    """Record a tap at 10 kHz from 20 ms before contact on, which lies anywhere between two samples."""
    moved, step_s = tap.motion(), 1e-4
    recorded = step_s * np.arange(round((moved.stop_s + 0.05) / step_s))
    since = recorded - 0.02 - step_s * rng.uniform()
    force = np.where(since > 0.0, moved.force_n(np.maximum(since, 0.0)), 0.0)
    position = np.where(since > 0.0, moved.position_m(np.maximum(since, 0.0)), 0.0)
    return replace(
        tap.capture(cycle=cycle),
        force=Channel(recorded, force + rng.normal(0.0, 0.4, force.size), 0.4),
        position=Channel(recorded, position + rng.normal(0.0, 1.5e-6, force.size), 1.5e-6),
    )


def test_what_a_tap_says_of_the_plant_is_not_said_twice() -> None:
    """One tap and the plant that was fitted to it alone: mu_s was off by 1.7 times what was said of it."""
    pulls = []
    for seed in range(25):
        tap = extract(Tap(2000 / 6e4, effects={}).capture(np.random.default_rng(900 + seed)))
        plant = fit_plant([tap], 9.81)
        found = plant.estimate(tap, plant.model).mu_s
        pulls.append((found.value - 0.2) / found.std)
    assert 0.7 < float(np.sqrt(np.mean(np.square(pulls)))) < 1.3


@pytest.mark.parametrize("at_contact_n", [0.0, 30.0])
def test_a_sample_at_first_contact_itself_is_no_misfit(at_contact_n: float) -> None:
    """There the force jumps from 0 to b v, and a logger may show either, or what lies between."""

    def begun(tap: Capture) -> Capture:
        force = tap.force
        assert force is not None
        values = np.append(at_contact_n, force.values)
        return replace(tap, force=replace(force, time_s=np.append(0.0, force.time_s), values=values))

    taps = campaign(1, {})
    found, kept = (fit_plant([extract(tap) for tap in given], 9.81) for given in (map(begun, taps), taps))
    assert found.gap == pytest.approx(kept.gap, abs=1e-3)
    assert found.model.plant.damping_n_s_per_m == pytest.approx(kept.model.plant.damping_n_s_per_m, rel=1e-4)


@pytest.mark.slow
def test_a_law_that_the_model_lacks_bends_it_little_and_is_seen() -> None:
    found = fit_plant([extract(tap) for tap in campaign(2, DRAG)], 9.81)
    assert found.gap > 1.5
    assert found.model.plant.stiffness_n_per_m == pytest.approx(7.1e5, rel=3e-3)
    assert found.model.plant.damping_n_s_per_m == pytest.approx(520.0, rel=0.02)
    assert found.model.ratio == pytest.approx(0.8, rel=0.15)
    assert abs(found.model.ratio - 0.8) < 2.5 * found.model.prior.ratio_std


def light_part(stroke_m: float, effects: dict[str, dict[str, float]], force_hz: float) -> list[Capture]:
    """Taps of 12 kg on another plant, their samples on whole milliseconds among others."""
    rng = np.random.default_rng(3)
    taps = [
        Tap(
            velocity / 6e4, 0.27 * (1 + 0.01 * rng.normal()), 0.8, 12.0, stroke_m,
            stiffness=4e5, damping=300.0, effects=effects,
        )
        for velocity in (2000, 3500, 6000)
        for _ in range(4)
    ]  # fmt: skip
    return [tap.capture(rng, cycle=number, force_hz=force_hz) for number, tap in enumerate(taps, 1)]


@pytest.mark.slow
def test_a_law_that_bends_everything_leaves_stiffness_and_damping_right() -> None:
    """A film this thick in a light part's way takes the fit of all to mu_k = mu_s, where it finds no rest."""
    film = {"viscous_friction": {"viscous_coefficient_n_s_per_m": 60.0}}
    found = fit_plant([extract(tap) for tap in light_part(1e-3, film, 2e4)], 9.81)
    assert found.gap > 5.0
    assert found.model.plant.stiffness_n_per_m == pytest.approx(4e5, rel=3e-3)
    assert found.model.plant.damping_n_s_per_m == pytest.approx(300.0, rel=0.02)
    assert abs(found.model.ratio - 0.8) < 2.5 * found.model.prior.ratio_std


def test_a_sample_at_the_very_halt_of_the_actuator_says_nothing_of_the_plant() -> None:
    """The force jumps there by b v: on which side of it the model has the sample is rounding."""
    found = fit_plant([extract(tap) for tap in light_part(2.5e-4, {}, 1e5)], 9.81)
    plant, prior = found.model.plant, found.model.prior
    assert prior.stiffness_std_n_per_m > 1.0, "what rounding decides tells nothing so exactly"
    assert abs(plant.stiffness_n_per_m - 4e5) < 4.0 * prior.stiffness_std_n_per_m
    assert abs(plant.damping_n_s_per_m - 300.0) < 4.0 * prior.damping_std_n_s_per_m
    assert abs(found.model.ratio - 0.8) < 4.0 * prior.ratio_std


def test_contact_constants_and_mass_need_no_law_of_friction() -> None:
    for effects in ({}, DRAG):
        for capture in campaign(3, effects)[4:]:
            tap = extract(capture)
            stiffness, damping = contact_constants(tap)
            assert stiffness == pytest.approx(7.1e5, rel=0.01)
            assert damping == pytest.approx(520.0, rel=0.05)
            assert estimate_mass(tap) == pytest.approx(capture.mass_kg, rel=0.03)


def test_what_the_part_does_late_in_its_slide_says_nothing_of_its_mass() -> None:
    for capture in campaign(5, {})[4:8]:
        tap = extract(capture)
        assert tap.slide is not None
        assert capture.position is not None
        late = tap.slide.separation_s + 0.3 * (tap.slide.stop_s - tap.slide.separation_s)
        values = capture.position.values.copy()
        values[capture.position.time_s > late] += 5e-4  # somebody knocks against the sensor
        knocked = replace(tap, capture=replace(capture, position=replace(capture.position, values=values)))
        knocked = replace(knocked, position=knocked.capture.position)
        assert estimate_mass(knocked) == estimate_mass(tap)


def test_bad_shots_are_left_out_and_a_campaign_of_them_is_refused() -> None:
    captures = campaign(4, {})
    captures[2] = replace(captures[2], position=None)
    assert 3 not in fit_plant([extract(tap) for tap in captures], 9.81).used
    with pytest.raises(PredictionError, match="no tap of the campaign can be used; shot 3: no position"):
        fit_plant([extract(tap) for tap in [captures[2]]], 9.81)
    with pytest.raises(PredictionError, match="there is none"):
        fit_plant([], 9.81)


@pytest.mark.parametrize("error", [0.004, 0.01, 0.03, 0.05])
def test_scatter_of_the_ratio_is_what_its_errors_do_not_exclude(
    error: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The root of its expected square, by quadrature over the density of contrasts, which hold no mean."""
    ratios = np.array([0.74, 0.77, 0.76, 0.78, 0.75, 0.79, 0.76])
    errors = error * np.array([1.0, 0.8, 1.2, 1.0, 1.1, 0.9, 1.0])
    shown = [
        SimpleNamespace(
            mu_s=0.2,
            mu_k=0.2 * ratio,
            mu_s_std=0.2 * math.hypot(own, 0.002) / ratio,
            mu_s_common_std=0.2 * 0.002 / ratio,
            immediate=0.0,
        )
        for ratio, own in zip(ratios, errors, strict=True)
    ]
    hidden = SimpleNamespace(mu_s=0.2, mu_k=0.02, mu_s_std=0.001, mu_s_common_std=0.0, immediate=0.5)
    vague = SimpleNamespace(mu_s=0.2, mu_k=0.02, mu_s_std=0.012, mu_s_common_std=0.0, immediate=0.0)

    def scatter(fits: list[SimpleNamespace]) -> float:
        monkeypatch.setattr("impactcell.prediction.joint_plant_fit.fit", lambda tap, _: fits[tap])
        return ratio_scatter(range(len(fits)), fit_model)  # type: ignore[arg-type]

    fit_model = printed_model()
    contrasts = null_space(np.ones((1, len(ratios)))).T
    prior_std = 0.03 * ratios.mean()

    def density(std: float) -> float:
        covariance = contrasts @ np.diag(errors**2 + std**2) @ contrasts.T
        seen = multivariate_normal.logpdf(contrasts @ ratios, np.zeros(len(contrasts)), covariance)
        return math.exp(float(seen) - 15.0 - 0.5 * (std / prior_std) ** 2)

    square, whole = (
        quad(lambda std, power=power: std**power * density(std), 0.0, 5.0 * prior_std, epsabs=0.0)[0]
        for power in (2, 0)
    )
    expected = math.sqrt(square / whole) if error < 0.04 else 0.0
    assert scatter([hidden, *shown, vague]) == pytest.approx(expected, rel=1e-3)
    assert scatter([*shown[:4], hidden]) == 0.0, "too few"


@pytest.mark.slow
@pytest.mark.parametrize("ratio_std", [0.0, 0.01, 0.03])
def test_mu_s_is_within_what_a_model_of_the_same_taps_says(ratio_std: float) -> None:
    """Slow taps, whose ratio scatters: where that was told as one number half of mu_s lay outside of 95 %."""
    pulls = []
    for seed in range(2):
        draw = np.random.default_rng([seed, 77])
        taps = [
            Tap(
                float(draw.uniform(1500.0, 3000.0)) / 6e4,
                0.2 * math.exp(0.02 * draw.standard_normal()),
                ratio=0.76 * math.exp(ratio_std * draw.standard_normal()),
                stroke_m=1.5e-3,
                effects={},
            )
            for _ in range(40)
        ]
        features = [extract(as_recorded(begun_within_a_step(tap, draw))) for tap in taps]
        model = fit_plant(features, 9.81).model
        for tap, seen in zip(taps, features, strict=True):
            mu_s = estimate_from_features(seen, model).mu_s
            if mu_s.quality is Quality.GOOD:
                pulls.append((mu_s.value - tap.mu_s) / mu_s.std)
    assert len(pulls) > 70
    assert float(np.mean(np.abs(pulls) < 1.96)) > 0.85


def begun_within_a_step(tap: Tap, draw: np.random.Generator) -> Capture:
    """Give a tap whose first contact lies anywhere in the sampling step before the first sample."""
    whole, moved, late_s = tap.capture(draw), tap.motion(), 1e-4 * draw.uniform()

    def counted(channel: Channel | None, values: Callable[[Samples], Samples]) -> Channel:
        assert channel is not None
        assert channel.noise_std is not None
        times = np.arange(1, len(channel.time_s) + 1) * 1e-4
        times = times[times > late_s]
        noise = draw.normal(0.0, channel.noise_std, len(times))
        return replace(channel, time_s=times, values=values(times - late_s) + noise)

    return replace(
        whole,
        force=counted(whole.force, moved.force_n),
        position=counted(whole.position, moved.position_m),
    )


def taps_of(cell: Tap, seed: int, mu_s_scatter: float, ratio_scatter: float) -> list[Features]:
    rng = np.random.default_rng(seed)
    taps = [
        replace(
            cell,
            velocity_m_s=velocity / 6e4,
            mu_s=cell.mu_s * math.exp(mu_s_scatter * rng.normal()),
            ratio=cell.ratio * math.exp(ratio_scatter * rng.normal()),
        )
        for velocity in (2000, 3000, 4000, 5000, 6000) * 6
    ]
    return [extract(tap.capture(rng, cycle=number)) for number, tap in enumerate(taps, 1)]


@pytest.mark.parametrize("seed", range(3))
def test_a_ratio_that_taps_show_to_one_side_only_is_not_known(seed: int) -> None:
    """The slowest taps move just about at once: that mu_s is not larger shows, and nothing else of it."""
    cell = Tap(0.1, 0.2118, 0.8148, 11.332, 1.5e-3, stiffness=5.679e5, damping=746.96, effects={})
    found = fit_plant(taps_of(cell, seed, 0.0, 0.01), 9.81).model
    assert abs(found.ratio - cell.ratio) < 2.5 * found.prior.ratio_std


@pytest.mark.parametrize("seed", range(3))
def test_a_part_that_is_met_again_between_two_samples_has_a_plant(seed: int) -> None:
    """The force jumps there; the fit went to and fro over a sample and had no end."""
    cell = Tap(0.1, 0.2184, 0.7594, 9.808, 1.5e-3, stiffness=4.3141e5, damping=782.34, effects={})
    found = fit_plant(taps_of(cell, seed, 0.03, 0.0), 9.81)
    assert found.gap < 1.05
    assert abs(found.model.plant.damping_n_s_per_m - cell.damping) < 1e-3 * cell.damping


@pytest.mark.parametrize("seed", range(2))
def test_k_and_b_are_those_of_the_first_contact(seed: int) -> None:
    """A stiff contact that is made again: over the flight between the two a regression had k an eighth."""
    cell = Tap(0.1, 0.2037, 0.8187, 6.33, 2.487e-3, stiffness=1.398e6, damping=457.46, effects={})
    slow = [tap for tap in taps_of(cell, seed, 0.01, 0.0) if tap.capture.velocity_m_s < 0.06]
    assert len(contact_spells(required(slow[0].force))) > 1
    constants = np.median([contact_constants(tap) for tap in slow], axis=0)
    assert constants[0] == pytest.approx(cell.stiffness, rel=0.2)
    plant = fit_plant(slow, 9.81).model.plant
    assert plant.stiffness_n_per_m == pytest.approx(cell.stiffness, rel=1e-3)
    assert plant.damping_n_s_per_m == pytest.approx(cell.damping, rel=1e-3)
