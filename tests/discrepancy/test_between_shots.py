"""What acts between shots is judged by shots: by chance as often as it says."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from impactcell.discrepancy.data import prepare, sensor_noise, split_held_out
from impactcell.discrepancy.model import ParameterEstimate
from impactcell.discrepancy.nominal_model import nominal_models
from impactcell.discrepancy.search import between_shots, chance_by_exchange, chance_of_narrowing, trace_rivals
from impactcell.discrepancy.search.factor_likeness import fits_to_factors
from impactcell.discrepancy.workflow import investigate
from tests.discrepancy.study import Job, campaign


@pytest.mark.parametrize("parameters", [1, 3])
def test_factors_without_an_effect_are_narrowed_by_chance_as_often_as_said(parameters: int) -> None:
    rng = np.random.default_rng(11)
    chances = []
    for _ in range(2000):
        factors = rng.standard_normal(30)
        columns = np.column_stack([np.ones(30), rng.standard_normal((30, parameters))])
        left = factors - columns @ np.linalg.lstsq(columns, factors, rcond=None)[0]
        chances.append(chance_of_narrowing(float(factors.std()), float(left.std()), 30, parameters))
    for level in (0.5, 0.05, 0.01):
        share = np.mean(np.array(chances) <= level)
        assert share == pytest.approx(level, abs=4.0 * np.sqrt(level * (1.0 - level) / 2000))


def test_factors_that_an_effect_explains_are_not_narrowed_by_chance() -> None:
    assert chance_of_narrowing(0.05, 0.02, 30, 1) < 1e-8
    assert chance_of_narrowing(0.05, 0.05, 30, 1) == pytest.approx(1.0)


ORDER = np.linspace(-0.5, 0.5, 20)


def test_exchange_of_shots_finds_what_scipy_finds() -> None:
    rng = np.random.default_rng(12)
    factors = 0.8 * ORDER + rng.standard_normal(20)
    reference = stats.permutation_test(
        (factors,),
        lambda values: abs(float(values @ ORDER)),
        permutation_type="pairings",
        alternative="greater",
        n_resamples=19_999,
        rng=np.random.default_rng(13),
    )
    chance = chance_by_exchange(factors, 0.01 * ORDER[None] + 3.0, np.random.default_rng(14))
    assert 0.01 < chance < 0.5
    assert chance == pytest.approx(reference.pvalue, abs=4.0 * np.sqrt(2.0 * chance / 19_999))


def test_shots_far_off_make_no_drift(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(between_shots, "EXCHANGES", 999)
    rng = np.random.default_rng(15)
    chances = []
    for _ in range(150):
        factors = rng.standard_t(1.0, 20)
        chances.append(chance_by_exchange(factors, ORDER[None], rng))
    for level in (0.5, 0.1):
        share = np.mean(np.array(chances) <= level)
        assert share == pytest.approx(level, abs=4.0 * np.sqrt(level * (1.0 - level) / 150))


def test_the_best_of_several_patterns_is_as_likely_by_chance_as_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(between_shots, "EXCHANGES", 999)
    rng = np.random.default_rng(16)
    patterns = np.vstack([ORDER, ORDER**2, np.sin(9.0 * ORDER), np.zeros(20)])
    chances = [chance_by_exchange(rng.standard_normal(20), patterns, rng) for _ in range(150)]
    share = np.mean(np.array(chances) <= 0.1)
    assert share == pytest.approx(0.1, abs=4.0 * np.sqrt(0.09 / 150))


def test_a_drift_is_no_order_by_chance() -> None:
    rng = np.random.default_rng(17)
    assert chance_by_exchange(ORDER + 0.1 * rng.standard_normal(20), ORDER[None], rng) == 5e-5
    assert chance_by_exchange(ORDER, np.zeros((1, 20)), rng) == 1.0


@pytest.mark.parametrize(
    ("rival", "spread", "tied", "explains"),
    [
        ("friction_patch", 0.01, True, True),
        ("friction_patch", 0.021, True, False),
        ("friction_patch", 0.03, False, False),
        ("friction_drift", 0.01, False, False),
    ],
)
def test_a_name_between_shots_gives_way_to_what_narrows_the_factors_within_them(
    rival: str, spread: float, tied: bool, explains: bool
) -> None:
    fitted: Any = SimpleNamespace(effects=("viscous_friction", rival), spread=spread)
    assert trace_rivals(0.02, [fitted], 30) == ((rival,) if tied else (), explains)


@pytest.mark.parametrize(
    ("spread", "tied"), [(0.02, ("surface_tilt",)), (0.018, ("surface_tilt",)), (0.03, ()), (0.01, None)]
)
def test_what_the_factors_speak_for_as_much_is_tied_whether_it_acts_between_shots_or_not(
    spread: float, tied: tuple[str, ...] | None
) -> None:
    best: Any = SimpleNamespace(effects=("direction_asymmetry",), spread=0.02)
    other: Any = SimpleNamespace(effects=("surface_tilt",), spread=spread)
    assert between_shots.factor_rivals(best, [best, other], 30) == tied


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4])
def test_a_tilt_is_as_strong_as_the_friction_factors_ask_for(seed: int) -> None:
    """The traces say nothing: the factors of uphill and downhill taps differ by 2 tan(a) / mu."""
    given = campaign(Job("model_error", ("surface_tilt", "wandering_force"), seed, shots=24), (1.5, 0.1))
    prepared = prepare(given)
    training, _ = split_held_out(prepared, seed)
    nominal = nominal_models(prepared, sensor_noise(prepared), training, None).start
    context: Any = SimpleNamespace(problem=nominal.problem, library=("surface_tilt", "viscous_friction"))
    fits = {fit.effects[-1]: fit for fit in fits_to_factors(context, nominal.fit, nominal.fit)}
    tilted = fits["surface_tilt"]
    assert tilted.coordinates[-1].value(tilted.theta[-1]) == pytest.approx(1.5 * 0.004, abs=1.5e-3)
    assert tilted.spread < 0.6 * nominal.fit.spread
    assert "viscous_friction" not in fits or fits["viscous_friction"].spread > 0.9 * nominal.fit.spread


@pytest.mark.long
def test_a_tilt_of_the_surface_is_not_called_friction_by_direction_beside_a_model_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of both the traces say nothing, so that no fit of the traces had the tilt."""
    for later, idle in (("find_law", lambda *_: None), ("hold_against_free_forms", lambda _, found: found)):
        monkeypatch.setattr(f"impactcell.discrepancy.workflow.{later}", idle)  # have tests of their own
    seed, library = 720_014, ("surface_tilt", "direction_asymmetry")
    job = Job("model_error", ("surface_tilt", "wandering_force"), seed, target=2.0, shots=40)
    found = investigate(campaign(job, (1.1658, 0.0828)), seed=seed, library=library)
    assert found.verdict == "tied"
    assert {*found.selection.ties[found.added[0]], *found.added} == set(library)


@pytest.mark.parametrize(
    ("effect", "sizes", "told"),
    [
        ("direction_asymmetry", [("relative_amplitude", -0.2, 0.22)], False),
        ("direction_asymmetry", [("relative_amplitude", 0.004, 0.014)], True),
        ("batch_shift", [("relative_change", -0.1, 0.1), ("relative_change", -0.05, 0.0)], False),
        ("batch_shift", [("relative_change", -0.1, 0.1), ("relative_change", -0.05, -0.01)], True),
    ],
)
def test_an_effect_has_a_size_whose_interval_does_not_hold_nothing(
    monkeypatch: pytest.MonkeyPatch, effect: str, sizes: list[tuple[str, float, float]], told: bool
) -> None:
    """The interval is that of the report, with the error in it that the traces share."""
    others = [ParameterEstimate("", "mu_k", -1, 0.2, -1.0, 1.0, at_bound=False)]
    own = [ParameterEstimate(effect, name, 0, 0.0, low, high, at_bound=False) for name, low, high in sizes]
    monkeypatch.setattr(between_shots, "estimate_parameters", lambda *_: (*others, *own))
    monkeypatch.setattr(between_shots, "linearise", lambda *_: None)
    monkeypatch.setattr(between_shots, "shared_error", lambda _: None)
    evidence: Any = SimpleNamespace(fit=SimpleNamespace(effects=(effect,)))
    assert between_shots.has_a_size(None, evidence) == told  # type: ignore[arg-type]
