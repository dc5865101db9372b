"""Parts of data, fits, laws, machines and report by themselves, against closed forms and their words."""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.discrepancy.data import driven_blocks, measured_drive, prepared_campaign
from impactcell.discrepancy.data.excitation import ExcitationStrategy
from impactcell.discrepancy.data.measured_drive import SmoothedDrive, position_response, smooth_drive
from impactcell.discrepancy.data.noise_floor import sensor_noise
from impactcell.discrepancy.data.phases import PHASES
from impactcell.discrepancy.laws import covariates, finding, grammar
from impactcell.discrepancy.machine import finding as machine_finding
from impactcell.discrepancy.machine import proof, simulation, uniform_records
from impactcell.discrepancy.machine.base_model import Response
from impactcell.discrepancy.machine.study import Study
from impactcell.discrepancy.model import initial_guess
from impactcell.discrepancy.model.forward import ShotParameters
from impactcell.discrepancy.model.parameters import NOMINAL_COORDINATES
from impactcell.discrepancy.model.phases import phase_positions
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.report import figures, sentences
from impactcell.errors import CampaignError
from impactcell.physics import Plant
from impactcell.physics.free_forms import FREE_FORMS


def test_a_part_that_turns_round_goes_on_by_the_ratio_of_its_accelerations() -> None:
    """Under a constant force back, v0 falls by (F + f) / m until it turns, and grows by (F - f) / m then.

    x(T) = t* v0 / 2 - a2 (T - t*)^2 / 2 with t* = v0 / a1, so that dx/dv0 = t* + (a2 / a1) (T - t*).
    """
    mass, force, friction, end = 3.0, 40.0, 5.0, 0.05
    time = np.linspace(0.0, end, 42)
    before, after = (force + friction) / mass, (force - friction) / mass
    turns = 16.5 * time[1]
    speed = np.where(time < turns, before * (turns - time), -after * (time - turns))
    drive = SmoothedDrive(time, np.full(len(time), -force), 1e-4)
    response, step = position_response(drive, speed, mass, friction), time[1]
    for knot in (3, 7, 12):
        by_speed = (turns - time[knot]) + after / before * (end - turns)
        assert response[-1, knot] == pytest.approx(step / mass * by_speed, rel=0.03)


def test_a_drive_that_is_a_line_stays_one() -> None:
    time = np.arange(0.0, 0.3, 4e-4)
    drive = smooth_drive(time, 5.0 - 30.0 * time, 0.3)
    assert drive.force_n == pytest.approx(5.0 - 30.0 * drive.time_s, abs=1e-6)


def test_friction_of_a_block_is_that_of_its_mass(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coulomb friction, mu_k m g, is what the whitener of a driven block takes the part to lose."""

    @dataclass
    class Block:
        times: Any
        values: Any
        drive: Any
        covariates: dict[str, float]
        whitener: Any = None

    time = np.linspace(0.0, 0.5, 200)
    position, empty, frictions = 0.02 * np.sin(12.0 * time), np.empty(0), []

    def noted(drive: SmoothedDrive, speed: np.ndarray, mass: float, friction: float) -> np.ndarray:
        frictions.append((mass, friction))
        return position_response(drive, speed, mass, friction)

    monkeypatch.setattr(measured_drive, "position_response", noted)
    block: Any = Block(
        (empty, time, empty),
        (empty, position, empty),
        np.vstack([time, 8.0 * np.cos(12.0 * time)]),
        {"mass": 2.0},
    )
    whitened = measured_drive.whiten_block(block, 1e-6, 9.81, 0.25)
    assert frictions == [(2.0, pytest.approx(0.25 * 2.0 * 9.81))]
    assert whitened.whitener.shape == (len(whitened.times[1]),) * 2


def test_a_slip_is_fast_and_of_one_direction() -> None:
    speed = np.concatenate(
        [np.full(20, 1e-4), np.full(30, 0.3), np.zeros(25), np.full(40, -0.2), np.full(20, 1e-4)]
    )
    parts = [(part.tolist(), sense) for part, sense in measured_drive._slip_intervals(speed)]
    assert parts == [([*range(20, 50)], 1.0), ([*range(75, 115)], -1.0)]


def test_blocks_are_cut_beside_a_stretch_without_samples() -> None:
    time = np.concatenate([np.arange(0.0, 2.0, 1e-3), np.arange(4.0, 12.0, 1e-3)])
    speed = np.sin(2.0 * np.pi * 5.0 * time)
    cuts = driven_blocks._cut_samples(time, speed)
    assert len(cuts) > 5
    assert np.median(np.abs(speed[cuts])) == pytest.approx(1.0, abs=0.02)
    assert np.abs(speed[cuts]).min() > 0.5
    assert time[cuts[0]] < 2.0 < 4.0 < time[cuts[-1]]


def test_a_column_of_nothing_but_zeros_does_not_vary() -> None:
    shots: Any = [
        SimpleNamespace(covariates={"zero": 0.0, "load": 2.0 + place, "same": 5.0, "gap": math.nan})
        for place in range(4)
    ]
    strategy: Any = SimpleNamespace(record_of=lambda _: 0)
    assert prepared_campaign._varying_covariates(strategy, shots) == ("load",)


def test_a_channel_that_shows_no_noise_and_states_none_is_refused() -> None:
    prepared: Any = SimpleNamespace(
        shots=(SimpleNamespace(values=(np.full(50, 3.0), np.empty(0), np.empty(0))),),
        stated_noise=(math.nan,) * 3,
    )
    with pytest.raises(CampaignError, match="neither is its noise stated"):
        sensor_noise(prepared)


def test_a_quarter_of_every_setting_is_held_out() -> None:
    """Whether a setting has many shots or one: over 400 splits, as often as chance allows."""
    velocities = np.array([1.0] * 8 + [2.0] * 5 + [3.0])
    shots: Any = [SimpleNamespace(velocity_m_s=velocity, direction=1) for velocity in velocities.tolist()]
    strategy: Any = None
    share = np.zeros(len(shots))
    for seed in range(400):
        training, held_out = ExcitationStrategy.split(strategy, shots, seed)
        assert sorted([*training, *held_out]) == list(range(len(shots)))
        share[held_out] += 1.0 / 400
    spread = 4.0 * math.sqrt(share.mean() * (1.0 - share.mean()) / 400)
    for velocity in np.unique(velocities):
        assert share[velocities == velocity].mean() == pytest.approx(share.mean(), abs=spread)


def test_the_place_within_a_phase_goes_from_nought_to_one() -> None:
    times = np.array([0.0, 0.1, 0.4, 0.5, 1.0, 2.0, 7.0, 8.0, 10.0])
    phase = np.array([0, 0, 0, 2, 2, 2, 1, 1, 1])

    class Shots:
        bounds = np.array([0, 6, 9])

        def __len__(self) -> int:
            return 2

    problem: Any = SimpleNamespace(shots=Shots())
    place = phase_positions(problem, phase, times)
    assert place == pytest.approx([0.0, 0.25, 1.0, 0.0, 1.0 / 3.0, 1.0, 0.0, 1.0 / 3.0, 1.0])
    assert phase.max() < len(PHASES)


def test_a_plant_that_is_given_is_where_the_fit_starts() -> None:
    plant = Plant(mu_s=0.26, mu_k=0.2, stiffness_n_per_m=2e7, damping_n_s_per_m=3e3)
    problem: Any = SimpleNamespace(coordinates=NOMINAL_COORDINATES)
    theta = initial_guess._coordinates_of(problem, plant)
    for coordinate, number in zip(NOMINAL_COORDINATES, theta, strict=True):
        name = coordinate.parameter
        expected = 1.3 if name == "ratio" else getattr(plant, name)
        assert coordinate.value(float(number)) == pytest.approx(expected)


def test_a_shot_at_rest_stays_at_rest_whatever_the_step() -> None:
    names = ("log_factor", "speed_m_s", "shift_m")
    problem: Any = SimpleNamespace(shot_parameter_names=names)
    at = ShotParameters(np.zeros(3), np.ones(3), np.array([0.0, 0.2, -0.1]), np.zeros(3))
    moved = Problem.step_shot_parameters(problem, at, np.full((3, 3), 0.01))
    assert moved.speed_m_s == pytest.approx([0.0, 0.21, -0.09])
    assert moved.log_factor == pytest.approx([0.01] * 3)
    assert moved.shift_m == pytest.approx([0.01] * 3)


def test_range_of_a_gap_where_nothing_is_left_is_students() -> None:
    """Noise of one and five blocks' squares about it: t with four degrees of freedom, 2.776 of an error."""
    squares = np.array([0.8, 1.3, 0.9, 1.1, 0.9])
    model: Any = SimpleNamespace(fit=SimpleNamespace(columns=(), coefficients=np.empty(0)))

    def blocks(values: np.ndarray) -> Any:
        return SimpleNamespace(losses=lambda *_: 2.0 * values, noise=np.full(len(values), 2.0))

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
        fall=SimpleNamespace(after=after), expected=(0.9, 1.1), train_gaps=(3.0, training)
    )
    assert machine_finding.MachineFinding.is_at_floor.fget(found) is expected  # type: ignore[attr-defined]


def test_spikes_are_taken_out_of_a_signal_far_from_nought() -> None:
    values = 100.0 + np.sin(np.linspace(0.0, 6.0, 600))
    spoilt = values.copy()
    spoilt[[150, 400]] += [30.0, -25.0]
    clean, spikes = uniform_records._without_spikes(spoilt)
    assert spikes == 2
    assert clean == pytest.approx(values, abs=0.02)


def test_the_correlation_time_is_that_which_went_in() -> None:
    """White noise averaged over m steps has the correlations 1 - l / m: their sum is (m + 1) / 2 steps."""
    rng, m, step = np.random.default_rng(2), 12, 0.01
    averaged = np.array([np.convolve(rng.normal(size=3000), np.ones(m), "valid") for _ in range(2)])
    rows = SimpleNamespace(
        target=averaged.ravel(), columns={}, record=np.repeat([0, 1], averaged.shape[1]),
        time_s=np.tile(step * np.arange(averaged.shape[1]), 2),
    )  # fmt: skip
    study: Any = SimpleNamespace(rows=lambda: rows, records=(None, None))
    model: Any = SimpleNamespace(fit=SimpleNamespace(columns=(), coefficients=()))
    assert Study._correlation_time(study, model) == pytest.approx(0.5 * (m + 1) * step, rel=0.3)


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
    model: Any = SimpleNamespace(base=SimpleNamespace(response=response))
    error = simulation.simulate_held_out(found, model)
    times = [record.time_s[stretch] for stretch in stretches]
    assert [(part[0], part[-1]) for part in times] == [
        (pytest.approx(2.0), pytest.approx(3.0)),
        (pytest.approx(7.0), pytest.approx(9.9)),
    ]
    assert (error.rmse, error.fit_percent) == (0.0, 100.0)


def test_covariates_of_a_law_are_the_motions_own_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    n = 400
    rng, sliding = np.random.default_rng(1), PHASES.index("loading")
    trajectory = SimpleNamespace(
        speed_m_s=rng.uniform(0.0, 0.2, n),
        part_displacement_m=rng.uniform(0.0, 1e-3, n),
        actuator_displacement_m=rng.uniform(1e-3, 3e-3, n),
    )
    items = [
        SimpleNamespace(velocity_m_s=0.3, direction=1, start_m=0.0),
        SimpleNamespace(velocity_m_s=0.5, direction=1, start_m=0.0),
    ]
    shots = SimpleNamespace(
        items=items,
        channel=np.arange(n) % 2,
        values=rng.uniform(10.0, 90.0, n),
        times=np.linspace(0.0, 1.0, n),
    )
    problem: Any = SimpleNamespace(shots=shots, sizes=np.array([150, 250]))
    model: Any = None
    monkeypatch.setattr(covariates, "trajectory_of", lambda *_: trajectory)
    monkeypatch.setattr(covariates, "sample_phases", lambda *_: np.full(n, sliding))
    forms = {form.covariate: form for form in FREE_FORMS.values() if not form.is_between_shots}
    strikes = np.repeat([0.3, 0.5], [150, 250])
    expected = {
        "speed": trajectory.speed_m_s,
        "indentation_rate": strikes - trajectory.speed_m_s,
        "force": shots.values[shots.channel == 0],
        "indentation": trajectory.actuator_displacement_m - trajectory.part_displacement_m,
    }
    assert len(expected.keys() & forms.keys()) > 2
    for name in expected.keys() & forms.keys():
        met = covariates.visited(problem, model, forms[name])
        assert met is not None
        assert met.values == pytest.approx(expected[name])
        assert met.upper == pytest.approx(expected[name].max())


@pytest.mark.parametrize(("lowest", "is_enough"), [(0.5, True), (0.78, True), (0.82, False)])
def test_what_varies_by_less_than_a_fifth_was_not_gone_through(lowest: float, is_enough: bool) -> None:
    form: Any = SimpleNamespace(covariate="position")
    assert (covariates._range(np.linspace(lowest, 1.0, 80), form) is not None) is is_enough


def test_a_range_that_begins_at_nought_has_the_atoms_of_positive_numbers() -> None:
    def names(lower: float) -> set[str]:
        return {
            item.term[0].name
            for item in grammar.shaped_terms(lower, 2.0, constant=True)
            if len(item.term) == 1
        }

    assert names(0.0) == names(0.5)
    assert names(-0.5) < names(0.0)


@pytest.mark.parametrize("smoothness", finding.SMOOTHNESS)
def test_only_the_smoothest_spline_tells_nothing_of_how_a_term_bends(
    monkeypatch: pytest.MonkeyPatch, smoothness: float
) -> None:
    monkeypatch.setattr(finding, "gives_energy", lambda _: False)
    form = SimpleNamespace(covariate="speed", effect=SimpleNamespace(equation="s(v)"))
    term: Any = SimpleNamespace(smoothness=smoothness, form=form)
    change: Any = SimpleNamespace(is_real=lambda: True, after=SimpleNamespace(of=lambda _: 1.0), parts=())
    said = finding._refusal(term, None, change, 2.0)
    assert bool(said) is (smoothness == max(finding.SMOOTHNESS))
    assert finding._refusal(term, SimpleNamespace(), change, 2.0) == ""  # type: ignore[arg-type]


def test_a_figure_names_the_setting_of_its_shot() -> None:
    shot = SimpleNamespace(number=7, velocity_m_s=0.02, mass_kg=1.5, direction=-1.0)
    assert figures._setting(shot) == "shot 7, 1200 mm/min, 1.5 kg, −"
    assert (
        figures._setting(SimpleNamespace(number=7, velocity_m_s=math.nan, mass_kg=math.nan, direction=1.0))
        == "shot 7, +"
    )


@pytest.mark.parametrize("ties", [(), ("quadratic_drag",)])
def test_a_tie_and_a_name_are_told_as_what_they_are(ties: tuple[str, ...]) -> None:
    result: Any = SimpleNamespace(
        validation=SimpleNamespace(gap_before=3.0, gap_after=1.0),
        conclusion=SimpleNamespace(
            verdict="tied" if ties else "named",
            established=("viscous_friction",),
            ties={"viscous_friction": ties},
            remaining=SimpleNamespace(explained=True),
        ),
    )
    said = sentences._conclusion(result)
    assert ("cannot tell apart" in said) is bool(ties)
    assert ("with it the held-out gap falls from 3.00 to 1.00" in said) is not bool(ties)
