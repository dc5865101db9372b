"""Taps as they are measured: mass, velocity and the sensors' scales are not exact. Truth: the simulator."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell.cell.preprocessing import fill_defaults
from impactcell.features import extract
from impactcell.physics import Plant
from impactcell.prediction import Model, Prior, estimate, waveform
from impactcell.prediction.capture_blocks import linearised_model
from impactcell.prediction.joint_plant_fit import fit_plant
from impactcell.prediction.linearised_model import POSITION_SCALE, parameters_of
from impactcell.records import (
    FORCE_SCALE_STD,
    MASS_STD,
    POSITION_SCALE_STD,
    VELOCITY_STD,
    Capture,
    Coefficient,
    Quality,
    as_recorded,
)
from impactcell.service.factory import cell_design
from impactcell.settings import read_cell
from impactcell.web.texts.reasons import german_reason
from tests.integration.processes import CONFIG
from tests.taps import VISCOUS, Tap

PLANT = Plant(6.5e5, 465.0, 0.2, 0.152, effects=VISCOUS)
MODEL = Model("reference", PLANT, Prior(6.5e3, 9.3, 0.03 * 0.76))
WRONG = ("mass", "velocity", "force", "position")
TOLD_STD = {
    "mass": MASS_STD,
    "velocity": VELOCITY_STD,
    "force": FORCE_SCALE_STD,
    "position": POSITION_SCALE_STD,
}


def told(capture: Capture, wrong: str, factor: float) -> Capture:
    """Give a capture of which one thing is by this factor not what it was."""
    if wrong == "mass":
        return replace(capture, mass_kg=factor * capture.mass_kg)
    if wrong == "velocity":
        return replace(capture, velocity_m_s=factor * capture.velocity_m_s)
    channel = getattr(capture, wrong)
    return replace(capture, **{wrong: replace(channel, values=factor * channel.values)})


@pytest.mark.parametrize("error", [0.0, 1e-3, 1e-2])
@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_told_a_little_wrong_bends_no_friction(wrong: str, error: float) -> None:
    """Taken as exact, a mass 0.1 % off put mu_s 10 % off (RMS), up to 26 standard deviations, status good."""
    rng = np.random.default_rng(11)
    pulls, stds, good = [], [], 0
    for _ in range(24):
        ratio = 0.76 * (1.0 + 0.03 * rng.standard_normal())
        tap = Tap(float(rng.uniform(0.033, 0.1)), float(rng.uniform(0.15, 0.25)), ratio)
        seen = told(tap.capture(rng, force_hz=1e5), wrong, 1.0 + error * rng.choice([-1.0, 1.0]))
        mu_s = estimate(as_recorded(seen), MODEL).mu_s
        good += mu_s.quality is Quality.GOOD
        pulls.append((mu_s.value - tap.mu_s) / mu_s.std)
        stds.append(mu_s.std / mu_s.value)
    assert np.abs(pulls).max() < 3.5
    assert math.sqrt(np.mean(np.square(pulls))) < 1.4
    assert np.median(stds) < 0.03
    assert good >= 22


@pytest.mark.parametrize("factor", [1.0, 0.999, 1.001, 0.997, 1.003, 0.99, 1.01])
def test_mu_k_is_right_where_the_position_is_told_a_little_wrong(factor: float) -> None:
    """Taken as exact, a position 0.3 % off put mu_k 5 to 10 standard deviations off, with status Good."""
    rng = np.random.default_rng(3)
    for velocity_m_s in (0.033, 0.06, 0.1):
        tap = Tap(velocity_m_s)
        seen = told(tap.capture(rng, force_hz=1e5), "position", factor)
        found, exact = (estimate(as_recorded(seen, position_scale_std=s), MODEL) for s in (0.003, 0.0))
        assert found.mu_k.quality is found.mu_s.quality is Quality.GOOD
        assert abs(found.mu_k.value - tap.mu_k) < 3.5 * found.mu_k.std
        assert abs(found.mu_s.value - tap.mu_s) < 3.0 * found.mu_s.std
        assert found.mu_k.std < 0.003 * found.mu_k.value
        assert own_std(found.mu_k) < 2e-3 * found.mu_k.value
        assert found.mu_s.std == pytest.approx(exact.mu_s.std, rel=0.05)
        assert own_std(found.mu_s) == pytest.approx(own_std(exact.mu_s), rel=0.02)


@pytest.mark.parametrize("longer", [0.998, 1.002])
@pytest.mark.parametrize("velocity_m_s", [0.033, 0.1])
def test_a_stroke_that_is_told_a_little_wrong_bends_no_mu_k(velocity_m_s: float, longer: float) -> None:
    """3 µm of stroke put mu_k of the taps that halt in contact up to 19 standard deviations off, Good."""
    rng = np.random.default_rng(4)
    stroke_m, halts = 1.5e-3, velocity_m_s > 0.09
    for mass_kg in (18.9, 25.2):
        tap = Tap(velocity_m_s, mass_kg=mass_kg, stroke_m=longer * stroke_m)
        seen = replace(tap.capture(rng, force_hz=1e5), stroke_m=stroke_m)
        mu_k = estimate(as_recorded(seen), MODEL).mu_k
        assert mu_k.quality is Quality.GOOD
        assert abs(mu_k.value - tap.mu_k) < 2.0 * mu_k.std
        assert (mu_k.std >= POSITION_SCALE_STD * mu_k.value) is halts
        assert own_std(mu_k) < 2e-3 * mu_k.value


@pytest.mark.parametrize("longer", [0.998, 1.002])
def test_a_velocity_told_too_small_does_not_hide_that_a_tap_halts_in_contact(longer: float) -> None:
    """By it the halt came later: mu_k took its scale from the stroke as if that were exact, Good."""
    tap, stroke_m = Tap(0.0845, stroke_m=longer * 1.5e-3), 1.5e-3
    separation_s = tap.motion().separation_s
    assert 0.99 * tap.velocity_m_s * separation_s < stroke_m < tap.velocity_m_s * separation_s
    seen = told(tap.capture(np.random.default_rng(4), force_hz=1e5), "velocity", 0.99)
    mu_k = estimate(as_recorded(replace(seen, stroke_m=stroke_m)), MODEL).mu_k
    assert mu_k.quality is Quality.GOOD
    assert abs(mu_k.value - tap.mu_k) < 2.0 * mu_k.std
    assert mu_k.std >= POSITION_SCALE_STD * mu_k.value


def own_std(of: Coefficient) -> float:
    """Give the part of a standard deviation that other taps do not share."""
    return math.sqrt(of.std**2 - of.common_std**2)


@pytest.mark.slow
def test_errors_as_large_as_told_are_covered() -> None:
    """All that is told of taps and of their plant off by as much as is said of it: Bayes' own coverage."""
    rng, pulls = np.random.default_rng(12), []
    for _ in range(60):
        ratio, stiffness, damping = np.exp(np.array([0.03, 0.01, 0.02]) * rng.standard_normal(3))
        tap = Tap(
            float(rng.uniform(0.033, 0.1)), float(rng.uniform(0.15, 0.25)), float(0.76 * ratio),
            stiffness=float(6.5e5 * stiffness), damping=float(465.0 * damping),
        )  # fmt: skip
        seen = tap.capture(rng, force_hz=1e5)
        for wrong, std in TOLD_STD.items():
            seen = told(seen, wrong, math.exp(std * rng.standard_normal()))
        found = estimate(as_recorded(seen), MODEL)
        off = found.mu_s.value - tap.mu_s, found.mu_k.value - tap.mu_k
        pulls.append([off[0] / found.mu_s.std, off[1] / found.mu_k.std])
    in_mu_s, in_mu_k = np.sqrt(np.mean(np.square(pulls), axis=0))
    assert 0.7 < in_mu_s < 1.4
    assert 0.7 < in_mu_k < 1.4


def test_the_scale_of_the_position_scales_what_the_model_says_of_it() -> None:
    """theta counts in standard deviations; its derivative is that of the logarithm of the scale."""
    seen = as_recorded(Tap().capture(np.random.default_rng(5), force_hz=1e5))
    response = linearised_model(extract(seen), PLANT)
    theta = np.append(parameters_of(PLANT), [0.3, -0.2, 0.1, 0.4, 0.0])
    force, position = response.linearise(theta).traces
    theta[POSITION_SCALE] = 2.0
    same, scaled = response.linearise(theta).traces
    assert same == pytest.approx(force, rel=1e-12)
    assert scaled == pytest.approx(math.exp(2.0 * POSITION_SCALE_STD) * position, rel=1e-12)
    copies = scaled.reshape(len(theta) + 1, -1)
    stepped = math.exp(1e-3 * POSITION_SCALE_STD) * copies[0]
    assert copies[1 + POSITION_SCALE] == pytest.approx(stepped, rel=1e-12)


def test_a_position_that_is_exact_has_no_scale_to_be_fitted() -> None:
    seen = Tap().capture(np.random.default_rng(8), force_hz=1e5)
    exact, nearly = (
        waveform.fit(extract(as_recorded(seen, position_scale_std=std)), MODEL) for std in (0.0, 1e-9)
    )
    assert exact.theta[POSITION_SCALE] == 0.0
    assert exact.mu_k == pytest.approx(nearly.mu_k, rel=1e-6)
    assert exact.mu_s == pytest.approx(nearly.mu_s, rel=1e-5)
    assert exact.mu_k_std == pytest.approx(nearly.mu_k_std, rel=1e-2)


def test_mu_k_from_the_deceleration_knows_no_more_of_the_scale() -> None:
    """A wave in the force that no model has leaves mu_k to the slide."""
    tap, rng = Tap(), np.random.default_rng(9)
    seen = tap.capture(rng, force_hz=1e5)
    force = seen.force
    assert force is not None
    wave = 5.0 * np.sin(2e3 * force.time_s) * (force.values > 5.0)
    seen = replace(seen, force=replace(force, values=force.values + wave))
    exact, found = (estimate(as_recorded(seen, position_scale_std=s), MODEL).mu_k for s in (0.0, 0.3))
    assert "from the mean deceleration of the slide" in found.reason
    assert found.std == pytest.approx(math.hypot(exact.std, 0.3 * found.value), rel=1e-9)


@pytest.mark.parametrize("mass_kg", [0.0, -1.0, math.nan])
def test_a_tap_of_no_mass_has_no_friction_and_no_fault(mass_kg: float) -> None:
    """With 0 kg it was a division by zero, with less than that a mu_k of 0.6."""
    found = estimate(replace(Tap().capture(np.random.default_rng(9)), mass_kg=mass_kg), MODEL)
    assert found.mu_s.quality is found.mu_k.quality is Quality.BAD
    assert "the part's mass or the actuator's velocity is not known" in found.mu_s.reason


@pytest.mark.parametrize("factor", [0.95, 0.97, 1.03])
@pytest.mark.parametrize("velocity_m_s", [0.04, 0.06, 0.09])
def test_a_position_quite_wrong_is_named_beside_what_looks_like_it(
    velocity_m_s: float, factor: float
) -> None:
    """Position and velocity larger by s, stiffness and damping smaller by s, are the same force."""
    tap = Tap(velocity_m_s)
    found = estimate(as_recorded(told(tap.capture(np.random.default_rng(2), 1e5), "position", factor)), MODEL)
    assert found.mu_k.quality is found.mu_s.quality is Quality.UNCERTAIN
    said = re.search(r"the position is (\S+) times that of the model: check its scale", found.mu_k.reason)
    assert said is not None
    assert 0.0085 < abs(float(said[1]) - 1.0) < 0.05
    assert (float(said[1]) > 1.0) is (factor > 1.0)
    assert "check the velocity" in found.mu_k.reason
    assert german_reason(found.mu_k.reason) is not None


@pytest.mark.parametrize(
    ("wrong", "factor", "said"),
    [
        ("mass", 0.95, r"the tap is that of (18\.[789]\d?|19) kg, not 17\.95 kg: check the mass"),
        ("velocity", 0.97, r"the tap is that of (3[56]\d\d) mm/min, not 3492 mm/min: check the velocity"),
        ("force", 1.05, r"the force is (1\.04\d|1\.05\d) times that of the model: check its scale"),
    ],
)
def test_what_is_told_quite_wrong_is_named(wrong: str, factor: float, said: str) -> None:
    tap = Tap()
    mu_s = estimate(as_recorded(told(tap.capture(np.random.default_rng(2), 1e5), wrong, factor)), MODEL).mu_s
    assert mu_s.quality is Quality.UNCERTAIN
    assert re.fullmatch(said, mu_s.reason)
    assert german_reason(mu_s.reason) is not None
    assert abs(mu_s.value - tap.mu_s) < 3.0 * mu_s.std


def test_a_cell_that_knows_its_mass_drive_and_sensors_better_sees_friction_better(tmp_path: Path) -> None:
    """Values of the YAML; that of sensors stands between the others."""
    text = (CONFIG / "cells" / "prototype.yaml").read_text(encoding="utf-8").replace("../", f"{CONFIG}/")
    for key, value in (
        ("mass_kg: 18.9", "mass_error_percent: 0.01"),
        ("stroke_mm: 1.5", "velocity_error_percent: 0"),
        ("force_noise_std_n: 0.4", "force_scale_error_percent: 0.01"),
        ("position_noise_std_um: 1.5", "position_scale_error_percent: 0.01"),
    ):
        text = text.replace(f"  {key}\n", f"  {key}\n  {value}\n")
    (tmp_path / "exact.yaml").write_text(text, encoding="utf-8")
    tap, stds, stds_of_mu_k = Tap(3000 / 6e4, stroke_m=1.5e-3), [], []
    for file in (CONFIG / "cells" / "prototype.yaml", tmp_path / "exact.yaml"):
        defaults = cell_design(read_cell(file)).defaults
        seen = fill_defaults(defaults, tap.capture(np.random.default_rng(6), 1e6))
        found = estimate(seen, MODEL)
        assert abs(found.mu_s.value - tap.mu_s) < 3.0 * found.mu_s.std
        assert abs(found.mu_k.value - tap.mu_k) < 3.0 * found.mu_k.std
        stds.append(found.mu_s.std)
        stds_of_mu_k.append(found.mu_k.std)
    assert stds[1] < 0.6 * stds[0]
    assert stds_of_mu_k[1] < 0.3 * stds_of_mu_k[0]


@pytest.mark.slow
@pytest.mark.parametrize("position", [1.0, 0.997, 1.003])
def test_a_campaign_told_a_little_wrong_has_the_right_plant(position: float) -> None:
    """A mass differs from tap to tap, the scale of the position does not."""
    rng = np.random.default_rng(4)
    taps, truths = [], []
    for cycle in range(1, 21):
        tap = Tap(
            float(rng.uniform(0.04, 0.09)), float(rng.uniform(0.17, 0.23)),
            mass_kg=float(rng.choice([10.0, 18.9])), effects={},
        )  # fmt: skip
        capture = told(
            tap.capture(rng, force_hz=1e5, cycle=cycle), "mass", 1.0 + 3e-3 * rng.standard_normal()
        )
        taps.append(extract(as_recorded(told(capture, "position", position))))
        truths.append(tap.mu_s)
    fit = fit_plant(taps, 9.81)
    assert fit.gap < 1.03
    assert fit.model.plant.stiffness_n_per_m == pytest.approx(6.5e5, rel=4e-3)
    assert fit.shared_error < 0.02
    assert fit.model.ratio == pytest.approx(0.76, rel=2.5 * fit.shared_error)
    said = [fit.estimate(tap, fit.model).mu_s for tap in taps]
    pulls = [(one.value - mu_s) / one.std for one, mu_s in zip(said, truths, strict=True)]
    assert math.sqrt(np.mean(np.square(pulls))) < 1.5
