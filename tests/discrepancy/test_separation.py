"""How far further shots take a model from its rival when that is fitted to all of them: linear truth."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from impactcell.discrepancy.search.further_shots import NewShots
from impactcell.discrepancy.search.indistinguishability import out_of_shot_loss
from impactcell.discrepancy.search.separation import LinearShots, Pair, refitted_separation
from impactcell.discrepancy.search.simulated_shots import DrawnShots
from impactcell.discrepancy.search.tie_redraws import _refitted, share_told

Array = NDArray[np.float64]
OLD, SAMPLES, SHARED = 9, 12, 3
SPREAD = 0.05
WEIGHT = np.array([1.0 / SPREAD**2])


def shots(rng: np.random.Generator, count: int, shared: int = SHARED) -> tuple[Array, Array]:
    """Derivatives of some shots by their own factor, which they tell well, (n, m), and shared, (n, p, m)."""
    return 100.0 * rng.normal(size=(count, SAMPLES)), rng.normal(size=(count, shared, SAMPLES))


def linear(own: Array, shared: Array, residual: Array) -> LinearShots:
    rows = np.concatenate([own[:, None], shared], axis=1)
    gram = rows @ np.swapaxes(rows, 1, 2)
    along = np.einsum("nam,nm->na", rows, residual)
    return LinearShots(gram, along, (residual**2).sum(1), np.zeros((len(own), 1)))


def brute_force(old: tuple[Array, Array], new: tuple[Array, Array], between: Array) -> float:
    """Least squared distance over shared numbers and each shot's own, by a general-purpose optimiser."""
    own, shared = (np.concatenate([a, b]) for a, b in zip(old, new, strict=True))
    count = len(own)
    target = np.concatenate([np.zeros((OLD, SAMPLES)), between])

    def residual(x: Array) -> Array:
        theta, factor = x[:SHARED], x[SHARED:]
        left = target - np.einsum("npm,p->nm", shared, theta) - factor[:, None] * own
        return np.concatenate([left.ravel(), factor / SPREAD])

    return float(2.0 * least_squares(residual, np.zeros(SHARED + count), xtol=1e-12, gtol=1e-12).cost)


@pytest.mark.parametrize("count", [1, 4])
def test_the_distance_left_is_that_of_a_least_squares_fit_to_old_and_new_shots(count: int) -> None:
    rng = np.random.default_rng(5)
    old, kind, between = shots(rng, OLD), shots(rng, 1), rng.normal(size=(1, SAMPLES))
    eliminated = linear(*old, np.zeros((OLD, SAMPLES))).eliminate(WEIGHT)
    seen = linear(*kind, between).eliminate(WEIGHT)
    repeated = (np.repeat(kind[0], count, 0), np.repeat(kind[1], count, 0))
    expected = brute_force(old, repeated, np.repeat(between, count, 0))
    assert refitted_separation(eliminated, seen, [count]) == pytest.approx(expected, rel=1e-7)
    assert expected < count * float(seen.cost[0])


def test_what_the_rival_can_do_without_harm_to_old_shots_separates_nothing() -> None:
    """One number that old shots do not see follows any number of new ones; one that they hold does not."""
    rng = np.random.default_rng(6)
    old, kind = shots(rng, OLD), shots(rng, 1)
    old[1][:, 0] = 0.0
    eliminated = linear(*old, np.zeros((OLD, SAMPLES))).eliminate(WEIGHT)
    free, held = (linear(*kind, 40.0 * kind[1][:, which]).eliminate(WEIGHT) for which in (0, 1))
    assert free.cost[0] > 100.0
    assert refitted_separation(eliminated, free, [20]) == pytest.approx(0.0, abs=1e-6)
    assert refitted_separation(eliminated, held, [20]) > 100.0


def pair_of(old: tuple[Array, Array]) -> Pair:
    """Two models that old shots do not tell apart at all, on data that stands for nothing else."""
    coordinate = SimpleNamespace(lower=-1e9, upper=1e9)
    model = SimpleNamespace(
        spread=SPREAD,
        coordinates=(coordinate,) * SHARED,
        theta=np.zeros(SHARED),
        misfit=lambda _: np.full(OLD, float(SAMPLES)),
    )
    items = [SimpleNamespace(group=number) for number in range(OLD)]
    problem = SimpleNamespace(
        sizes=np.full(OLD, SAMPLES), shots=SimpleNamespace(items=items), shot_parameter_names=("log_factor",)
    )
    factors = np.linspace(-1.5, 1.5, OLD)[:, None] * SPREAD
    seen = linear(*old, np.zeros((OLD, SAMPLES)))
    seen = LinearShots(seen.gram, seen.along, seen.square, factors)
    return Pair(cast("Any", problem), cast("Any", (model, model)), (seen, seen))


def new_of(kind: tuple[Array, Array], between: Array) -> NewShots:
    """One kind of new shots, both models with the same derivatives."""
    rows = np.concatenate([kind[0], kind[1][0]])
    every = np.concatenate([rows, rows, between])
    return NewShots((every @ every.T)[None], (between**2).sum(1), np.array([True]))


def told(pair: Pair, new: NewShots, count: int) -> float:
    groups = np.arange(100, 100 + count)
    return share_told(pair, new, np.zeros(count, dtype=int), groups, 200, np.random.default_rng(0))


def test_more_shots_tell_more_surely_and_none_do_what_the_rival_absorbs() -> None:
    rng = np.random.default_rng(8)
    old, kind = shots(rng, OLD), shots(rng, 1)
    old[1][:, 0] = 0.0
    pair = pair_of(old)
    between = rng.normal(size=(1, SAMPLES))
    shares = [told(pair, new_of(kind, between), count) for count in (1, 4, 12)]
    assert shares[0] < 0.5 < 0.9 < shares[2]
    assert shares == sorted(shares)
    assert told(pair, new_of(kind, 40.0 * kind[1][:, 0]), 12) < 0.1


def refitted(own: Array, shared: Array, y: Array, start: Array) -> tuple[Array, float]:
    """Log-likelihood of every shot by a fit without it, and the spread of the factors, by numpy alone.

    A shot's own factor, `start` where the data have none beside, is fitted to it with the spread's weight.
    """
    spread = SPREAD
    for _ in range(4):
        A = (own**2).sum(1) + spread**-2

        def cost(theta: Array, shot: int, A: Array = A, spread: float = spread) -> tuple[float, float]:
            left = y[shot] - theta @ shared[shot]
            step = float(own[shot] @ left - start[shot] / spread**2) / A[shot]
            left = left - step * own[shot]
            return float(left @ left) + ((start[shot] + step) / spread) ** 2, start[shot] + step

        def fit(places: Array, A: Array = A, spread: float = spread) -> Array:
            rows, values = [], []
            for shot in places:
                # Whitened for a factor of that spread: the root of I - own own' / A.
                along = own[shot] / np.linalg.norm(own[shot])
                lost = 1.0 - np.sqrt(1.0 - float(own[shot] @ own[shot]) / A[shot])
                root = np.eye(SAMPLES) - lost * np.outer(along, along)
                rows.append(root @ shared[shot].T)
                values.append(root @ (y[shot] + start[shot] * own[shot]))
            solved: Array = np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
            return solved

        every = np.arange(len(own))
        factors = np.array([cost(fit(every), shot)[1] for shot in every])
        spread = float(np.sqrt(np.mean(factors**2)))
    each = [-0.5 * cost(fit(every[every != shot]), shot)[0] - np.log(spread) for shot in every]
    return np.array(each), spread


def test_a_redraw_is_judged_as_a_fit_to_all_its_shots_judges_it() -> None:
    rng = np.random.default_rng(8)
    old, kind = shots(rng, OLD), shots(rng, 1)
    pair = pair_of(old)
    between = rng.normal(size=(1, SAMPLES))
    own, shared = (np.concatenate([a, np.repeat(b, 3, 0)]) for a, b in zip(old, kind, strict=True))
    start = np.concatenate([pair.old[0].own[:, 0], np.zeros(3)])
    noise = rng.normal(size=(1, 3, SAMPLES))
    changes = np.zeros((1, 3, 2 * (1 + SHARED) + 1))
    changes[..., 0] = SPREAD * rng.normal(size=3)
    changes[..., 1 : 1 + SHARED] = 0.1 * rng.normal(size=SHARED)
    made = noise[0] + changes[0, :, :1] * kind[0] + changes[0, :, 1 : 1 + SHARED] @ kind[1][0]
    rows = np.concatenate([kind[0], kind[1][0], kind[0], kind[1][0], between])
    drawn = DrawnShots(np.zeros(3, dtype=int), noise @ rows.T, changes)
    nothing = np.zeros((OLD, SAMPLES))
    ours, theirs = [], []
    for which, beside in enumerate((0.0, between)):
        layout = (which * (1 + SHARED), 1 + SHARED, np.arange(OLD + 3))
        ours.append(_refitted(pair, which, new_of(kind, between), drawn, layout))
        theirs.append(refitted(own, shared, np.concatenate([nothing, made + beside]), start))
        assert ours[-1].spread[0] == pytest.approx(theirs[-1][1], rel=1e-3)
    difference = theirs[0][0] - theirs[1][0]
    assert float(difference.sum()) > 2.0
    assert ours[0].each[0] - ours[1].each[0] == pytest.approx(difference, abs=0.01)


def test_shots_that_the_rival_can_only_follow_by_their_friction_widen_its_factors() -> None:
    rng = np.random.default_rng(9)
    old, kind = shots(rng, OLD), shots(rng, 1)
    pair = pair_of(old)
    held_by_factors = Pair(pair.problem, pair.models, pair.old, by_factors=True)
    near, far = (new_of(kind, size * SPREAD * kind[0]) for size in (0.2, 40.0))
    assert told(held_by_factors, near, 4) < 0.2
    assert told(held_by_factors, far, 4) > 0.9


def test_a_shot_loses_out_of_shot_what_a_fit_without_it_leaves() -> None:
    """Linear least squares, each shot left out in turn and refitted by numpy."""
    rng = np.random.default_rng(7)
    _, shared = shots(rng, OLD)
    y = rng.normal(size=(OLD, SAMPLES))
    theta = np.linalg.lstsq(np.concatenate(np.swapaxes(shared, 1, 2)), y.ravel(), rcond=None)[0]
    left = y - np.einsum("npm,p->nm", shared, theta)
    H, u = shared @ np.swapaxes(shared, 1, 2), np.einsum("npm,nm->np", shared, left)
    loss = out_of_shot_loss(H, np.array([u, 2.0 * u]), np.arange(OLD), np.zeros(SHARED))
    for shot in range(OLD):
        others = np.arange(OLD) != shot
        design = np.concatenate(np.swapaxes(shared[others], 1, 2))
        apart = np.linalg.lstsq(design, y[others].ravel(), rcond=None)[0]
        outside = y[shot] - apart @ shared[shot]
        expected = 0.5 * float(outside @ outside - left[shot] @ left[shot])
        assert loss[0, shot] == pytest.approx(expected, rel=1e-9)
    assert loss[1] == pytest.approx(4.0 * loss[0])
