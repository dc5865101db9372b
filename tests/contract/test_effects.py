"""What every effect of the library owes: it vanishes, stays finite, dissipates where it says so."""

import math
import re
import textwrap
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.errors import PhysicsError
from impactcell.physics import (
    Ensemble,
    Kind,
    LawKind,
    Parameter,
    Plant,
    TapInput,
    effects,
    simulate_free_slide,
    simulate_tap,
)
from impactcell.physics.effects import LIBRARY

# Names that are used from outside and stay as they are; an effect that is added needs no line here.
VOCABULARY = {
    "viscous_friction": ("viscous_coefficient_n_s_per_m",),
    "stribeck_friction": ("friction_increase", "stribeck_velocity_m_s"),
    "quadratic_drag": ("drag_coefficient_n_s2_per_m2",),
    "surface_tilt": ("tilt_rad",),
    "hertz_contact": ("exponent",),
    "hunt_crossley_damping": ("damping_n_s_per_m2",),
    "actuator_droop": ("speed_loss_m_per_s_n", "time_constant_s"),
    "actuator_ramp": ("ramp_time_s",),
    "position_dependent_friction": ("gradient_per_m",),
    "periodic_friction": ("amplitude", "period_m", "phase_rad"),
    "friction_patch": ("amplitude", "position_m", "width_m"),
    "adhesion": ("force_n", "range_m"),
    "presliding_compliance": ("stiffness_n_per_m",),
    "restoring_force": ("stiffness_n_per_m",),
    "mass_error": ("relative_error",),
    "force_sensor_lag": ("time_constant_s",),
    "position_sensor_lag": ("time_constant_s",),
    "force_sensor_gain": ("relative_error",),
    "force_sensor_offset": ("offset_n",),
    "force_saturation": ("limit_n",),
    "channel_skew": ("delay_s",),
    "stiction_ageing": ("increase_per_decade",),
    "friction_drift": ("relative_change",),
    "batch_shift": ("relative_change",),
    "direction_asymmetry": ("relative_amplitude",),
}
TAPS = [
    TapInput(v, m, 1.5e-3, direction=d, start_m=0.001, dwell_s=30.0, shot=3, shots=10, batch=b)
    for v, m, d, b in (
        (0.02, 18.9, 1, 0),
        (0.04, 12.6, -1, 1),
        (0.06, 18.9, 1, 2),
        (0.1, 25.2, -1, 1),
        (0.1, 5.0, 1, 0),
    )
]
TIMES = [np.arange(0, 1300) * 1.0003e-4] * len(TAPS)
NOMINAL = np.array([6.5e5, 465.0, 0.2, 0.152])
every = pytest.mark.parametrize("identifier", sorted(LIBRARY))


def ensemble(*identifiers: str) -> Ensemble:
    return Ensemble(TAPS, identifiers, force_time_s=TIMES, position_time_s=TIMES, actuator_time_s=TIMES)


def values(identifier: str, choose) -> list[float]:
    made: list[float] = []
    for parameter in LIBRARY[identifier].parameters:
        made += [choose(parameter)] * (2 if parameter.per_batch else 1)
    return made


def flat(traces) -> np.ndarray:
    return np.concatenate([traces.force_n / 300.0, traces.position_m / 5e-3, traces.actuator_m / 1e-3])


def test_published_names_stay() -> None:
    names = {name: tuple(p.name for p in effect.parameters) for name, effect in LIBRARY.items()}
    assert {name: names.get(name) for name in VOCABULARY} == VOCABULARY


@every
def test_it_says_what_it_is(identifier: str) -> None:
    effect = LIBRARY[identifier]
    assert effect.identifier == identifier
    assert effect.equation
    assert effect.reference
    assert effect.meaning.endswith(".")
    assert effect.look_at
    assert not effect.look_at.endswith(".")  # it goes on a sentence
    assert effect.phases
    assert bool(effect.laws) != (effect.between is not None)
    assert any(not math.isnan(parameter.null) for parameter in effect.parameters)
    for parameter in effect.parameters:
        assert parameter.unit
        assert parameter.lower < parameter.upper
        assert parameter.lower <= parameter.typical <= parameter.upper
        assert math.isnan(parameter.null) or parameter.lower <= parameter.null <= parameter.upper
    if effect.kind is Kind.BETWEEN_SHOTS:
        assert effect.between is not None


@every
def test_it_vanishes_at_its_null_value(identifier: str) -> None:
    def null(parameter: Parameter) -> float:
        return parameter.typical if math.isnan(parameter.null) else parameter.null

    theta = np.concatenate([NOMINAL, values(identifier, null)])
    with_it, without = ensemble(identifier).traces(theta), ensemble().traces(NOMINAL)
    np.testing.assert_allclose(flat(with_it), flat(without), rtol=0.0, atol=2e-9)
    left_out = Plant(*NOMINAL, effects={identifier: {}})
    assert simulate_tap(left_out, TAPS[2]).displacement_m == pytest.approx(
        simulate_tap(Plant(*NOMINAL), TAPS[2]).displacement_m, rel=1e-9
    )


@every
def test_it_shows_at_its_typical_value(identifier: str) -> None:
    theta = np.concatenate([NOMINAL, values(identifier, lambda parameter: parameter.typical)])
    change = flat(ensemble(identifier).traces(theta)) - flat(ensemble().traces(NOMINAL))
    assert np.abs(change).max() > 1e-3


@every
def test_it_is_finite_everywhere_in_its_range(identifier: str) -> None:
    rng = np.random.default_rng(3)
    model = ensemble(identifier)

    def draw(parameter: Parameter) -> float:
        low = max(parameter.lower, parameter.typical / 30.0 if parameter.lower >= 0.0 else parameter.lower)
        return rng.uniform(low, min(parameter.upper, 30.0 * parameter.typical))

    ends = [
        values(identifier, lambda p: p.lower),
        values(identifier, lambda p: p.upper),
        *(values(identifier, draw) for _ in range(8)),
    ]
    for some in ends:
        traces = model.traces(np.concatenate([NOMINAL, some]))
        assert np.isfinite(flat(traces)).all()


@every
def test_its_derivatives_are_finite_and_converge(identifier: str) -> None:
    theta = np.concatenate([NOMINAL, values(identifier, lambda parameter: parameter.typical)])
    model = ensemble(identifier)
    own = model.names[4:]
    coarse, fine = (
        flat(model.sensitivities(theta, own, relative_step=step)).reshape(-1) for step in (1e-5, 1e-6)
    )
    assert np.isfinite(fine).all()
    # Away from the few samples that an event passes over within the step.
    miss = np.abs(coarse - fine)
    scale = np.abs(fine).max()
    assert np.quantile(miss, 0.99) < 1e-4 * scale
    assert np.abs(fine).max() > 0.0


@pytest.mark.parametrize("identifier", sorted(name for name, effect in LIBRARY.items() if effect.dissipates))
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_it_takes_energy_and_never_gives_any(identifier: str, data: st.DataObject) -> None:
    effect = LIBRARY[identifier]
    p = np.array(
        [
            data.draw(st.floats(max(parameter.lower, 1e-6), min(parameter.upper, 1e6)), parameter.name)
            for parameter in effect.parameters
        ]
    )
    rate = data.draw(st.floats(-2.0, 2.0), "rate")
    for kind, law in effect.laws.items():
        if kind is LawKind.BODY:
            assert law(data.draw(st.floats(-1.0, 1.0), "x"), rate, 18.9, 9.81, p) * rate <= 0.0
        elif kind is LawKind.KINETIC:
            assert law(abs(rate), 0.0, 0.0, 0.0, p) >= 0.0
        elif kind is LawKind.CONTACT:
            assert law(data.draw(st.floats(0.0, 1e-2), "d"), rate, 6.5e5, 465.0, p) * rate >= 0.0
        else:
            pytest.fail(f"no way to tell whether a law of kind {kind.name} dissipates")


@pytest.mark.parametrize("identifier", sorted(name for name, effect in LIBRARY.items() if effect.dissipates))
def test_a_slide_with_it_is_never_longer(identifier: str) -> None:
    given_values = {p.name: p.typical for p in LIBRARY[identifier].parameters}
    plain, with_it = Plant(*NOMINAL), Plant(*NOMINAL, effects={identifier: given_values})
    for speed in (0.01, 0.1, 0.3):
        tap = TapInput(1.0, 18.9)
        assert (
            simulate_free_slide(with_it, tap, speed).displacement_m
            <= simulate_free_slide(plain, tap, speed).displacement_m
        )


def test_effects_compose_in_any_order() -> None:
    some = ("surface_tilt", "hertz_contact", "force_sensor_gain", "force_sensor_offset", "periodic_friction")
    typical = {name: {p.name: p.typical for p in LIBRARY[name].parameters} for name in some}
    there, back = (
        simulate_tap(Plant(*NOMINAL, effects={name: typical[name] for name in order}), TAPS[3])
        for order in (some, some[::-1])
    )
    assert there.displacement_m == pytest.approx(back.displacement_m, rel=1e-9)
    assert there.peak_force_n == pytest.approx(back.peak_force_n, rel=1e-9)


def test_all_effects_at_once() -> None:
    everything = {
        name: {p.name: [p.typical, p.typical] if p.per_batch else p.typical for p in effect.parameters}
        for name, effect in LIBRARY.items()
    }
    motion = simulate_tap(Plant(*NOMINAL, effects=everything), TAPS[3])
    assert math.isfinite(motion.displacement_m)
    assert motion.peak_force_n <= LIBRARY["force_saturation"].parameters[0].typical


def test_a_new_file_is_all_it_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "constant_pull.py").write_text(
        textwrap.dedent(
            '''
            """A constant force along +1."""
            from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, Phase

            def pull(_a, _b, _c, _d, p):
                return p[0]

            EFFECT = Effect(
                identifier="constant_pull",
                kind=Kind.BODY,
                equation="+P",
                reference="a weight on a string",
                phases=(Phase.FREE_SLIDE,),
                parameters=(Parameter("pull_n", "N", null=0.0, lower=-10.0, upper=10.0, typical=1.0),),
                laws={LawKind.BODY: pull},
            )
            '''
        )
    )
    (tmp_path / "misnamed.py").write_text((tmp_path / "constant_pull.py").read_text())
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    with pytest.raises(PhysicsError, match=r"misnamed\.py calls its effect 'constant_pull'"):
        effects._discover()
    (tmp_path / "misnamed.py").unlink()
    library = effects._discover()
    assert set(library) == {*LIBRARY, "constant_pull"}
    monkeypatch.setattr(effects, "LIBRARY", library)
    pulled = Plant(*NOMINAL, effects={"constant_pull": {"pull_n": 5.0}})
    moved = simulate_free_slide(pulled, TapInput(1.0, 18.9), 0.1)
    assert moved.displacement_m == pytest.approx(0.1**2 / 2.0 / (0.152 * 9.81 - 5.0 / 18.9), rel=1e-9)


def test_names_of_parameters_carry_their_units() -> None:
    suffix = {"m": "_m", "s": "_s", "N": "_n", "rad": "_rad", "1": "", "1/m": "_per_m", "m/s": "_m_s"}
    for effect in LIBRARY.values():
        for parameter in effect.parameters:
            ending = suffix.get(parameter.unit, "")
            assert re.search(f"{ending}$", parameter.name), (effect.identifier, parameter.name)
