"""Friction along the stroke against slides integrated apart from the product; deviance and replay."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from impactcell.features import extract, required
from impactcell.physics import Plant, TapInput, free_motion
from impactcell.records import Channel, Quality
from impactcell.serialization import pack, unpack
from impactcell.tracking.model_gap import gap_cusum
from impactcell.tracking.signature import friction_profile, tracker
from impactcell.tracking.signature.tracker import CycleConditions
from tests.benchmarks._slides import slide

SETTINGS = tracker.SignatureSettings()
GRID = SETTINGS.grid_m
NOISE = 0.42e-6


def textured(cycle, bump=0.0):
    rng = np.random.default_rng([1, cycle])
    a, b = 0.01 * rng.normal(), 0.005 * rng.normal()

    def friction(x):
        near = bump * np.exp(-0.5 * ((x - 1e-3) / 0.25e-3) ** 2)
        return 0.2 * (1.0 + a + b * (x / 1e-3 - 1.0) + 0.03 * np.sin(2.0 * np.pi * x / 1.3e-3) + near)

    return friction


def test_what_the_model_knows_to_depend_on_the_speed_is_taken_out():
    """Stribeck friction, drag and a tilt, integrated apart from the product; slides of either direction."""
    from scipy.integrate import solve_ivp

    effects = {
        "stribeck_friction": {"friction_increase": 0.03, "stribeck_velocity_m_s": 0.04},
        "quadratic_drag": {"drag_coefficient_n_s2_per_m2": 400.0},
        "surface_tilt": {"tilt_rad": 0.01},
    }
    plant, mass = Plant(6.5e5, 465.0, 0.26, 0.2, effects=effects), 18.9

    def stopped(_, y):
        return y[1]

    stopped.terminal = True
    for direction in (1, -1):

        def motion(_, y, direction=direction):
            friction = 0.2 + 0.03 * math.exp(-((y[1] / 0.04) ** 2))
            tilt = direction * 9.81 * math.sin(0.01)
            return [y[1], -9.81 * friction - 400.0 / mass * y[1] ** 2 - tilt]

        path = solve_ivp(motion, (0, 1), [0, 0.09], events=stopped, rtol=1e-10, dense_output=True)
        t = np.arange(0.0, path.t[-1], 1e-5)
        noisy = direction * path.sol(t)[0] + NOISE * np.random.default_rng(0).normal(size=len(t))
        capture, _ = slide(textured(0), 0.09, 1e4, NOISE, 0)
        capture = replace(capture, position=Channel(t, noisy, NOISE), direction=direction)
        known = partial(free_motion.acceleration, plant, TapInput(0.05, mass, direction=direction))
        state = tracker.initial_state(SETTINGS)
        found = tracker.update(
            SETTINGS, state, extract(capture), CycleConditions(acceleration=known)
        ).signature
        inner = 0.85 * path.y[0, -1] > GRID
        assert found.friction[inner] == pytest.approx(0.2, abs=0.002)
        without = tracker.update(SETTINGS, state, extract(capture)).signature
        assert np.abs(without.friction[inner] - 0.2).max() > 0.008


def viscous(speed):
    """k_v / m = 4.5 / s."""
    return -4.5 * speed


@pytest.fixture(scope="module")
def learned():
    state = tracker.initial_state(SETTINGS)
    outcomes = []
    for cycle in range(90):
        capture, _ = slide(textured(cycle), 0.09 + 0.001 * (cycle % 3), 1e4, NOISE, cycle)
        outcomes.append(tracker.update(SETTINGS, state, extract(capture)))
        state = outcomes[-1].state
    return state, outcomes


@pytest.mark.parametrize(("rate", "bound"), [(1e3, 0.0045), (1e5, 0.0012)])
def test_friction_against_an_independent_slide(rate, bound):
    def friction(x):
        return 0.2 * (1.0 + 0.1 * np.exp(-0.5 * ((x - 1e-3) / 0.4e-3) ** 2))

    capture, distance = slide(friction, 0.09, rate, NOISE, 3)
    found = tracker.update(SETTINGS, tracker.initial_state(SETTINGS), extract(capture)).signature
    use = np.abs(GRID / distance - 0.5) < 0.4
    error = found.friction[use] - friction(GRID[use])
    assert math.sqrt((error**2).mean()) < bound
    assert ((error / found.friction_std[use]) ** 2).mean() < 3.0
    assert np.isnan(found.friction[distance + 1e-4 < GRID]).all()


@pytest.mark.parametrize("beyond", [0.1, 0.3])
def test_friction_beyond_the_grid_is_none_on_it(beyond):
    """A slide of twice the grid whose second half is on another surface says of the first what it is."""
    end = GRID[-1]

    def friction(x):
        return 0.2 + (beyond - 0.2) / (1.0 + np.exp(-(x - 1.3 * end) / 0.05e-3))

    capture, distance = slide(friction, 0.17, 1e4, NOISE, 3)
    assert distance > 1.3 * end
    found = tracker.update(SETTINGS, tracker.initial_state(SETTINGS), extract(capture)).signature
    error = found.friction - 0.2
    assert np.isfinite(error).all()
    assert ((error / found.friction_std) ** 2).mean() < 3.0
    assert found.friction_std.max() < 0.02


def test_viscous_friction_of_the_model_is_taken_out():
    from scipy.integrate import solve_ivp

    def stopped(_, y):
        return y[1]

    stopped.terminal = True
    path = solve_ivp(
        lambda _, y: [y[1], -9.81 * 0.2 - 4.5 * y[1]],
        (0, 1),
        [0, 0.09],
        events=stopped,
        rtol=1e-10,
        dense_output=True,
    )
    t = np.arange(0.0, path.t[-1], 1e-5)
    capture, _ = slide(textured(0), 0.09, 1e4, NOISE, 0)
    noisy = path.sol(t)[0] + NOISE * np.random.default_rng(0).normal(size=len(t))
    capture = replace(capture, position=Channel(t, noisy, NOISE))
    with_model = tracker.update(
        SETTINGS, tracker.initial_state(SETTINGS), extract(capture), CycleConditions(acceleration=viscous)
    )
    inner = slice(2, 13)
    assert with_model.signature.friction[inner] == pytest.approx(0.2, abs=0.002)
    without = tracker.update(SETTINGS, tracker.initial_state(SETTINGS), extract(capture))
    assert without.signature.friction[2] - without.signature.friction[12] > 0.01


def test_normal_cycles_are_not_deviant_and_a_bump_is_with_its_place(learned):
    state, outcomes = learned
    assert not any(o.deviation for o in outcomes)
    assert [o.judged for o in outcomes].index(True) == 58  # the first eight show no variation yet, fifty do
    capture, _ = slide(textured(500, bump=0.1), 0.09, 1e4, NOISE, 500)
    odd = tracker.update(SETTINGS, state, extract(capture))
    assert odd.deviation is not None
    assert odd.deviation.statistic > odd.deviation.threshold == 5.0
    assert odd.signature.deviates_at_m == pytest.approx(1e-3, abs=0.3e-3)
    # a deviant cycle is not learned from
    assert pack(odd.state.reference) == pack(state.reference)


@pytest.mark.parametrize("bump", [0.05, 0.1, 0.2, 0.4, 0.8])
def test_size_and_place_of_a_bump_are_those_of_the_likeliest_one(learned, bump):
    """The rarest one owes least to what was learned, which says nothing of where the friction is off."""
    state, _ = learned
    for cycle in range(500, 504):
        capture, _ = slide(textured(cycle, bump=bump), 0.09, 1e4, NOISE, cycle)
        odd = tracker.update(SETTINGS, state, extract(capture))
        assert odd.deviation.size == pytest.approx(0.2 * bump, rel=0.25, abs=0.003)
        assert abs(odd.deviation.size - 0.2 * bump) < 3.0 * odd.deviation.size_std < 0.3 * bump
        assert odd.signature.deviates_at_m == pytest.approx(1e-3, abs=0.15e-3)


def varying(cycle):
    """Level, tilt and bend of the friction all vary, the latter most where short slides do not get."""
    a, b, c = 0.005 * np.random.default_rng([8, cycle]).normal(size=3) * (2.0, 1.0, 1.0)

    def friction(x):
        shape = a + b * (x / 1e-3 - 1.0) + c * np.cos(np.pi * x / 2e-3)
        return 0.2 * (1.0 + 0.03 * np.sin(2.0 * np.pi * x / 1.3e-3) + shape)

    return friction


@pytest.mark.parametrize("speeds", [[0.07] * 120 + [0.07, 0.08, 0.09, 0.1] * 10, [0.09] * 70 + [0.06] * 20])
def test_another_velocity_is_no_alarm_where_viscous_friction_is_known(speeds):
    state, odd = tracker.initial_state(SETTINGS), []
    for cycle, speed in enumerate(speeds):
        capture, _ = slide(varying(cycle), speed, 2e3, NOISE, cycle, viscous_per_mass=4.5)
        done = tracker.update(SETTINGS, state, extract(capture), CycleConditions(acceleration=viscous))
        state = done.state
        if done.deviation is not None:
            odd.append(cycle)
    assert odd == []


def test_a_place_is_judged_only_once_its_variation_is_known():
    # slides that come to a place the eighth time: its mean is known by then, how cycles vary there is not
    phase = np.random.default_rng(2).uniform(0.0, 6.28)
    state, odd = tracker.initial_state(SETTINGS), []
    for cycle, speed in enumerate([0.07] * 70 + [0.07, 0.08, 0.09, 0.1] * 8):
        a, b, c = 0.005 * np.random.default_rng([2, cycle]).normal(size=3) * (2.0, 1.0, 1.0)

        def friction(x, a=a, b=b, c=c):
            shape = a + b * (x / 1e-3 - 1.0) + c * np.cos(np.pi * x / 2e-3)
            return 0.2 * (1.0 + 0.03 * np.sin(2.0 * np.pi * x / 1.3e-3 + phase) + shape)

        capture, _ = slide(friction, speed, 2e3, NOISE, cycle, viscous_per_mass=4.5)
        done = tracker.update(SETTINGS, state, extract(capture), CycleConditions(acceleration=viscous))
        state = done.state
        if done.deviation is not None:
            odd.append(cycle)
    assert odd == []


def test_longer_slides_after_another_material_are_no_alarm():
    state, odd = tracker.initial_state(SETTINGS), []
    for cycle, speed in enumerate([0.07] * 70 + [0.07, 0.08, 0.09, 0.1] * 14):
        capture, _ = slide(varying(cycle), speed, 2e3, NOISE, cycle)
        done = tracker.update(SETTINGS, state, extract(capture), CycleConditions(restart=cycle == 70))
        state = done.state
        if done.deviation is not None:
            odd.append(cycle)
    assert odd == []


def test_the_first_cycles_of_another_material_are_judged_by_what_is_known_of_it():
    # few cycles learned, a step of level with the new material, then one part with a bump
    settings = tracker.SignatureSettings(learned_cycles=15)
    state, odd = tracker.initial_state(settings), []
    for cycle in range(1, 31):
        usual, step, bump = varying(cycle), 0.06 * (cycle >= 16), 0.3 * (cycle == 28)

        def friction(x, usual=usual, step=step, bump=bump):
            return usual(x) * (1.0 + step + bump * np.exp(-0.5 * ((x - 1.2e-3) / 0.3e-3) ** 2))

        capture, _ = slide(friction, 0.08, 1e4, NOISE, cycle)
        done = tracker.update(
            settings, state, extract(capture), CycleConditions(batch_id="A" if cycle < 16 else "B")
        )
        state = done.state
        if done.deviation is not None:
            odd.append(cycle)
    assert odd == [28]


def test_t_squared_is_about_its_three_degrees_of_freedom(learned):
    _, outcomes = learned
    scores = [o.signature.t_squared for o in outcomes if o.judged]
    assert 0.8 < np.mean(scores) < 6.0


def test_another_material_is_learned_before_it_is_judged(learned):
    state, _ = learned
    capture, _ = slide(textured(1), 0.09, 1e4, NOISE, 1)
    first = tracker.update(
        SETTINGS, replace(state, batch_id="A"), extract(capture), CycleConditions(batch_id="B")
    )
    assert not first.judged
    assert "being learned, 5 more cycles" in first.signature.reason
    after = first.state
    for cycle in range(2, 8):
        after = tracker.update(
            SETTINGS,
            after,
            extract(slide(textured(cycle), 0.09, 1e4, NOISE, cycle)[0]),
            CycleConditions(batch_id="B"),
        ).state
    assert tracker.update(SETTINGS, after, extract(capture), CycleConditions(batch_id="B")).judged


@pytest.mark.parametrize(("every", "begins_anew"), [(3, True), (6, True), (30, False)])
def test_many_deviant_cycles_between_others_are_how_cycles_vary(learned, every, begins_anew):
    state, _ = learned
    deviant, unjudged = 0, 0
    for cycle in range(1, 121):
        friction = textured(1000 + cycle, 0.3 if cycle % every == 0 else 0.0)
        done = tracker.update(SETTINGS, state, extract(slide(friction, 0.09, 1e4, NOISE, 1000 + cycle)[0]))
        state = done.state
        deviant += done.deviation is not None
        unjudged += not done.judged
    assert (unjudged > 0) == begins_anew
    assert deviant <= 15
    assert begins_anew or deviant == 4


@pytest.mark.parametrize(
    ("position", "why"),
    [
        (None, "no position channel"),
        (Channel(np.arange(5.0), np.arange(5.0)), "5 usable samples"),
        (Channel(np.arange(100) * 1e-4, np.full(100, 0.1), NOISE), "did not slide"),
        (Channel(np.arange(100) * 1e-4, np.full(100, 0.1)), "constant"),
        (Channel(np.arange(100) * 1e-4, np.full(100, math.nan), NOISE), "0 usable samples"),
    ],
)
def test_a_capture_without_a_slide_says_why(learned, position, why):
    state, _ = learned
    capture, _ = slide(textured(1), 0.09, 1e4, NOISE, 1)
    done = tracker.update(SETTINGS, state, extract(replace(capture, position=position)))
    assert why in done.signature.reason
    assert done.signature.quality is Quality.BAD
    assert not done.judged
    assert pack(done.state) == pack(state)


def test_a_restored_state_replays_to_the_same_bits(learned):
    state, _ = learned
    capture, _ = slide(textured(7), 0.09, 1e4, NOISE, 7)
    restored = unpack(tracker.SignatureState, pack(state))
    ours, theirs = (tracker.update(SETTINGS, s, extract(capture)) for s in (state, restored))
    assert pack(ours.state) == pack(theirs.state)
    assert ours.signature.friction.tobytes() == theirs.signature.friction.tobytes()


def test_smoothing_is_the_posterior_averaged_over_its_strength():
    capture, _ = slide(textured(4, bump=0.2), 0.09, 1e4, NOISE, 4)
    seen = friction_profile.information(required(extract(capture).segment), GRID, 9.81)
    n = seen.coefficients
    G, h, D = seen.matrix[:n, :n], seen.vector[:n], friction_profile.roughness(n)
    strengths = friction_profile.SMOOTHING_STRENGTHS * np.trace(G) / np.trace(D)
    means = np.array([np.linalg.solve(G + strength * D, h) for strength in strengths])
    fits = (n - 2) * np.log(strengths) - [np.linalg.slogdet(G + strength * D)[1] for strength in strengths]
    weights = np.exp(0.5 * (fits + means @ h - (fits + means @ h).max()))
    weights /= weights.sum()
    mean = weights @ means
    covariance = np.einsum("k,ki,kj->ij", weights, means - mean, means - mean)
    covariance += sum(
        w * np.linalg.inv(G + strength * D) for w, strength in zip(weights, strengths, strict=True)
    )
    found, _ = friction_profile.smooth(seen, GRID)
    assert found == pytest.approx(mean, rel=1e-6)
    value, std = friction_profile.friction(seen, GRID)
    row = np.zeros((n - 2, n))
    for k in range(n - 2):
        row[k, k : k + 3] = np.array([1.0, 4.0, 1.0]) / 6.0
    met = np.isfinite(value)
    assert (met == (seen.reached_m >= GRID)).all()
    assert value[met] == pytest.approx((row @ mean)[: met.sum()], rel=1e-6)
    assert std[met] == pytest.approx(np.sqrt(np.diag(row @ covariance @ row.T))[: met.sum()], rel=1e-4)


def test_splines_reproduce_a_straight_line():
    capture, distance = slide(lambda x: 0.2 + 5.0 * x, 0.09, 1e5, 1e-9, 2)
    found = tracker.update(SETTINGS, tracker.initial_state(SETTINGS), extract(capture)).signature
    use = np.abs(GRID / distance - 0.5) < 0.4
    assert found.friction[use] == pytest.approx(0.2 + 5.0 * GRID[use], abs=2e-4)
    assert friction_profile.roughness(5) @ np.arange(5.0) == pytest.approx(0.0)


def test_a_model_gap_is_found_at_the_designed_rate():
    rng = np.random.default_rng(0)
    state, alarms = gap_cusum.GapState(), 0
    for cycle in range(20_000):
        done = gap_cusum.update(state, float(np.exp(0.05 * rng.normal())), cycle, 1000.0, 1.0)
        state = done.state
        if done.exceeds:
            alarms += 1
            state = replace(state, excess=0.0)
    assert 8 <= alarms <= 34
    found = []
    for cycle in range(100):
        done = gap_cusum.update(state, float(1.2 * np.exp(0.05 * rng.normal())), 20_000 + cycle, 1e5, 1.0)
        state = done.state
        found.append(done.exceeds)
    assert found.index(True) < 12
    assert done.evidence.size == pytest.approx(0.2, abs=0.15)
    back = [gap_cusum.update(state, 1.0, 30_000, 1e5, 1.0)]
    while back[-1].exceeds:
        back.append(gap_cusum.update(back[-1].state, 1.0, 30_000 + len(back), 1e5, 1.0))
    assert len(back) < 20


def test_a_gap_that_is_no_number_is_left_out():
    for bad in (math.nan, math.inf, -1.0, 0.0):
        done = gap_cusum.update(gap_cusum.GapState(), bad, 1, 1e5, 1.0)
        assert done.exceeds is None
        assert done.reason
        assert done.state == gap_cusum.GapState()


def test_the_usual_scatter_of_a_gap_is_that_of_its_logarithms():
    gaps, state = np.exp(0.1 * np.random.default_rng(4).normal(size=40)), gap_cusum.GapState()
    for cycle, gap in enumerate(gaps.tolist()):
        done = gap_cusum.update(state, gap, cycle, 1e5, 1.0)
        state = done.state
    logarithms = np.log(gaps)
    usual = math.exp(logarithms.mean())
    assert done.evidence.size == pytest.approx(gaps[-1] - usual)
    assert done.evidence.size_std == pytest.approx(usual * logarithms.std(ddof=1))


@pytest.mark.parametrize("samples", [4, 5, 40, 221, 900])
def test_speed_of_the_cubic_is_numpys_to_the_bit(samples):
    rng = np.random.default_rng(samples)
    time = 1e-4 * np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, samples - 1))])
    distance = 0.07 * time - 1.2 * time**2 + NOISE * rng.normal(size=samples)
    cubic = np.polynomial.Polynomial.fit(time, distance, 3, domain=[0.0, time[-1]], window=[0.0, 1.0])
    speed = friction_profile._speed_of_cubic(time, distance)
    np.testing.assert_array_equal(speed, cubic.deriv()(time))
