"""Records with few samples in a period of their motion, and motion that counts as noise."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import BaseModel, investigate_machine
from impactcell.discrepancy.machine.records.fine_sampling import finely_sampled, highest_frequency
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.report import german_machine_sentences, machine_sentences
from impactcell.discrepancy.report.german_notes import note as german_note
from impactcell.discrepancy.report.machine_result import machine_document
from impactcell.records import Capture, Channel
from impactcell.settings.base_model import read_base_model

RATE_HZ = 600.0
"""Nine samples in a period of the resonance, three in one of the fastest part of the drive."""
MASS_KG, DAMPING, STIFFNESS, CUBIC = 0.005, 0.22, 1000.0, 4e9
"""Of an oscillator that swings a tenth of a millimetre to either side; SI."""
OSCILLATOR = """\
format: 1
coordinate: translation
excitation: driven
predicts: position
mass_kg: {value: 0.008, std: free}
terms: [viscous_friction, restoring_force]
nuisances:
  force_offset: {std: 0.01}
"""


@lru_cache
def oscillations(cubic: float, seconds: float = 1.2) -> tuple[Capture, ...]:
    """Eight records under sums of sines up to 200 Hz, by another integrator than the workflow's."""
    rng = np.random.default_rng(5)
    shots = []
    for number in range(1, 9):
        frequency = 2.0 * math.pi * np.linspace(4.0, 200.0, 40)
        phase = rng.uniform(0.0, 2.0 * math.pi, frequency.size)
        time = np.arange(0.0, seconds, 1.0 / RATE_HZ)

        def drive(t: float, frequency: np.ndarray = frequency, phase: np.ndarray = phase) -> float:
            return 0.005 * float(np.sin(frequency * t + phase).sum())

        def rates(t: float, state: np.ndarray, drive: object = drive) -> tuple[float, float]:
            q, v = state
            return v, (drive(t) - DAMPING * v - STIFFNESS * q - cubic * q**3) / MASS_KG  # type: ignore[operator]

        run = solve_ivp(rates, (0.0, seconds), (0.0, 0.0), t_eval=time, rtol=1e-7, atol=1e-11, max_step=1e-3)
        force = np.array([drive(t) for t in time]) + rng.normal(0.0, 1e-4, time.size)
        position = run.y[0] + rng.normal(0.0, 1e-7, time.size)
        shots.append(
            Capture(number, math.nan, math.nan, Channel(time, force, None), Channel(time, position, None))
        )
    return tuple(shots)


@pytest.fixture(name="base")
def _base(tmp_path_factory: pytest.TempPathFactory) -> BaseModel:
    file = tmp_path_factory.mktemp("base") / "base.yaml"
    file.write_text(OSCILLATOR, encoding="utf-8")
    return read_base_model(file)[0]


@pytest.mark.slow
def test_a_hardening_spring_is_found_with_nine_samples_a_period(base: BaseModel) -> None:
    """In motions of a tenth of a millimetre, whose cube is 1e-12 m³."""
    finding = investigate_machine(Campaign(Excitation.DRIVEN, oscillations(CUBIC)), base)
    assert (finding.verdict, finding.established) == ("named", ("hardening_spring",))
    parameters = machine_document(finding)["effects"][0]["parameters"]
    assert parameters["cubic_stiffness_n_per_m3"]["value"] == pytest.approx(CUBIC, rel=0.05)
    nominal = machine_document(finding)["nominal"]
    assert nominal["inertia"]["value"] == pytest.approx(MASS_KG, rel=0.02)
    before, after = (simulated.rmse for simulated in finding.simulated)
    assert after < 0.2 * before
    [note] = [note for note in finding.notes if "samples in a period" in note]
    assert "between them it was taken to go as sine waves" in note
    assert "kommen" in german_note(note)[1]
    assert machine_document(finding)["noise_floor"]["noise_std"] == pytest.approx([1e-4, 1e-7], rel=0.5)


@pytest.mark.slow
def test_nothing_is_named_where_the_spring_is_straight(base: BaseModel) -> None:
    finding = investigate_machine(Campaign(Excitation.DRIVEN, oscillations(0.0)), base)
    assert not finding.established
    assert finding.law is None


@pytest.mark.slow
def test_motion_that_counts_as_noise_is_no_reason_to_say_that_nothing_is_missing(base: BaseModel) -> None:
    """Records too short to see how fast they move: what differs between neighbours is what moves."""
    finding = investigate_machine(Campaign(Excitation.DRIVEN, oscillations(CUBIC, 0.8)), base)
    assert finding.fall.after < 0.5
    assert finding.verdict == "untested"
    assert "State noise_std_n and noise_std_m" in machine_sentences.headline(finding)
    assert "noise_std_n und noise_std_m der Sensoren angeben" in german_machine_sentences.headline(finding)
    turning = replace(finding, base=replace(base, coordinate=Coordinate.ROTATION))
    assert "State noise_std_n_m and noise_std_rad" in machine_sentences.headline(turning)
    free = replace(turning, records=tuple(replace(one, force=0.0 * one.force) for one in finding.records))
    assert "State noise_std_rad of the sensors" in machine_sentences.headline(free)
    stated = tuple(
        replace(
            shot,
            force=replace(shot.force, noise_std=0.05),
            position=replace(shot.position, noise_std=5e-5),
        )
        for shot in oscillations(CUBIC, 0.8)
        if shot.force and shot.position
    )
    hidden = investigate_machine(Campaign(Excitation.DRIVEN, stated), base)
    assert hidden.verdict == "untested"
    assert [one.name for one in hidden.clear_strengths] == ["hardening_spring"]


def record(values: np.ndarray, force: np.ndarray, noise: float = 1.0) -> UniformRecord:
    time = np.arange(values.size) / RATE_HZ
    return UniformRecord(1, "", time, values, force, 1.0, {}, 0, (noise, noise), (True, True))


def test_between_its_samples_a_motion_goes_on_as_it_was() -> None:
    time = np.arange(1200) / RATE_HZ

    def motion(t: np.ndarray) -> np.ndarray:
        return np.sin(2.0 * math.pi * 187.0 * t + 0.3) + 0.5 * np.cos(2.0 * math.pi * 71.0 * t) + 0.2 * t

    [finer], samples = finely_sampled([record(motion(time), motion(time + 0.01))])
    assert samples == pytest.approx(600.0 / 187.0, rel=0.05)
    assert finer.finer >= 24.0 / samples
    began_s = 16 / RATE_HZ
    assert finer.step_s == pytest.approx(1.0 / (RATE_HZ * finer.finer))
    assert np.abs(finer.position - motion(began_s + finer.time_s)).max() < 2e-3
    assert np.abs(finer.force - motion(began_s + 0.01 + finer.time_s)).max() < 2e-3
    assert finer.sensor_noise == pytest.approx((1.0, 1.0))


def test_noise_of_a_mean_is_what_it_was() -> None:
    """Of fine samples a mean over some coarse ones scatters as it did."""
    rng = np.random.default_rng(3)
    time = np.arange(60_000) / RATE_HZ
    white = rng.standard_normal(time.size)
    loud = 1e3 * np.sin(2.0 * math.pi * 150.0 * time)
    [noisy], _ = finely_sampled([record(loud + white, white)])
    [still], _ = finely_sampled([record(loud, 0.0 * white)])
    width = 8 * noisy.finer
    apart = noisy.position - still.position
    means = apart[: apart.size // width * width].reshape(-1, width).mean(axis=1)
    assert means.std() == pytest.approx(noisy.noise[0] / math.sqrt(width), rel=0.1)


def test_records_that_are_fine_stay_as_they_are() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(4000) / RATE_HZ
    slow = np.sin(2.0 * math.pi * 3.0 * time)
    quantised = np.round(200.0 * slow) / 200.0
    for values in (slow, slow + 0.05 * rng.standard_normal(time.size), quantised, np.cumsum(slow > 0.9)):
        before = record(np.asarray(values, dtype=float), slow)
        [after], samples = finely_sampled([before])
        assert after is before
        assert math.isinf(samples)


def test_the_fastest_motion_is_told_from_noise() -> None:
    rng = np.random.default_rng(6)
    place = np.arange(8192)
    noise = 0.02 * rng.standard_normal(place.size)
    fastest, std = highest_frequency(np.sin(2.0 * math.pi * 0.2 * place) + noise)
    assert fastest == pytest.approx(0.2, abs=0.01)
    assert std == pytest.approx(0.02, rel=0.1)
    assert highest_frequency(noise)[0] == 0.0


def test_a_short_record_beside_long_ones_is_made_as_fine() -> None:
    time = np.arange(1200) / RATE_HZ
    fast = np.sin(2.0 * math.pi * 150.0 * time)
    records, _ = finely_sampled([record(fast, fast), record(fast[:60], fast[:60])])
    assert records[0].finer == records[1].finer > 1
    assert len(records[1].position) == (60 - 1 - 2 * 16) * records[1].finer + 1
    assert finely_sampled([record(fast[:60], fast[:60])])[1] == math.inf
