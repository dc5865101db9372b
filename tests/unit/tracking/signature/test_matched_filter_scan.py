"""The scan against the same geometry worked out with scipy, on shapes of which some cannot be seen."""

import math

import numpy as np
import pytest
from scipy.linalg import subspace_angles
from scipy.stats import norm

from impactcell.tracking.signature import deviation_shapes, deviation_size, friction_profile
from impactcell.tracking.signature import matched_filter_scan as product

LENGTH, POINTS = 4e-3, 17
SHAPES = deviation_shapes.deviation_shapes(LENGTH, POINTS)
GRID = np.linspace(0.0, LENGTH, POINTS)


def drawn(seed, learned):
    """Root R of information P = R'R, coordinates z of the scores u = R'z, and what was learned, R C."""
    rng = np.random.default_rng(seed)
    n = POINTS + 2
    smooth = np.cos(np.pi * np.outer(np.arange(n), np.arange(n) + 0.5) / n) / (1.0 + np.arange(n)[:, None])
    root = smooth * np.exp(rng.normal(size=n)) + 0.01 * rng.normal(size=(n, n))
    return root, rng.normal(size=n) * rng.choice([0.3, 1.0, 1.6], n), learned * rng.normal(size=(n, 3))


class Sphere:
    """Shapes as vectors v = R s, on which a normal cycle draws from a standard normal distribution."""

    def __init__(self, rows, root, z, learned, bounds):
        self.v, self.z, self.learned, self.bounds = rows @ root.T, z, root @ learned, bounds

    def is_seen(self, row):
        return self.v[row] @ self.v[row] >= self.bounds.least

    def squared_and_rarity(self, direction):
        """Square of a score, and the normal score as rare when its variance was learned in part."""
        squared = (direction @ self.z) ** 2 / self.bounds.scale
        freedom = self.bounds.cycles / max(np.sum((direction @ self.learned) ** 2), 1e-6) ** 2
        return squared, math.sqrt(freedom * math.log1p(squared / freedom))

    def single(self, vector):
        if vector @ vector < self.bounds.least:
            return 1.0
        return 2.0 * norm.sf(self.squared_and_rarity(vector / np.linalg.norm(vector))[1])

    def apart(self, p, q):
        p, q = (self.v[k] / np.linalg.norm(self.v[k]) for k in (p, q))
        return math.acos(min(max(p @ q, -1.0), 1.0))

    def bump(self, across, down):
        seen = [row for row in range(across * down) if self.is_seen(row)]
        if not seen:
            return 1.0, -1
        scores = {row: self.squared_and_rarity(self.v[row] / np.linalg.norm(self.v[row])) for row in seen}
        c = max(rarity for _, rarity in scores.values())
        corners, edges = [], {}
        for i in range(down):
            for k in range(across):
                a, right, below = i * across + k, k + 1 < across, i + 1 < down
                lines = (
                    [(a, a + 1)] * right
                    + [(a, a + across)] * below
                    + [(a + 1, a + across)] * (right and below)
                )
                edges |= {frozenset(line): 0 for line in lines if set(line) <= set(seen)}
                if right and below:
                    corners += [(a, a + 1, a + across), (a + 1, a + across, a + across + 1)]
        triangles, area = [corner for corner in corners if set(corner) <= set(seen)], 0.0
        for p, q, r in triangles:
            one, two, opposite = self.apart(p, q), self.apart(p, r), self.apart(q, r)
            cosine = (one**2 + two**2 - opposite**2) / (2.0 * one * two)
            area += 0.5 * one * two * math.sqrt(max(1.0 - cosine**2, 0.0))
            for line in ((p, q), (p, r), (q, r)):
                edges[frozenset(line)] += 1
        # an edge of one triangle is passed once, of none twice: there and back
        boundary = sum((2 - beside) * self.apart(*sorted(line)) for line, beside in edges.items())
        euler = len(seen) - len(edges) + len(triangles)
        tail = euler * norm.sf(c) + 0.5 * boundary * math.exp(-c * c / 2.0) / (2.0 * math.pi)
        tail += area * c * math.exp(-c * c / 2.0) / (2.0 * math.pi) ** 1.5
        return min(1.0, 2.0 * tail), max(seen, key=lambda row: scores[row][0]) % across

    def ripple(self, first, waves):
        planes = {}
        for wave in range(waves):
            pair = self.v[first + 2 * wave : first + 2 * wave + 2]
            if np.linalg.eigvalsh(pair @ pair.T)[0] >= self.bounds.least:
                planes[wave] = np.linalg.qr(pair.T)[0]
        if not planes:
            return 1.0
        best, area = 0.0, 0.0
        for wave, plane in planes.items():
            along = plane @ (plane.T @ self.z)
            best = max(best, self.squared_and_rarity(along / np.linalg.norm(along))[1])
            if wave - 1 in planes:
                angles = subspace_angles(plane, planes[wave - 1])
                area += 2.0 * math.pi * math.asin(math.sqrt(np.mean(np.sin(angles) ** 2)))
        return min(1.0, math.exp(-best * best / 2.0) * (1.0 + area * best / (2.0 * math.pi) ** 1.5))


@pytest.mark.parametrize("reached", [1.3e-3, LENGTH])
@pytest.mark.parametrize("unseen", [0.0, 0.35, 0.7])
@pytest.mark.parametrize(("seed", "learned"), [(1, 0.0), (2, 0.02), (3, 0.1)])
def test_every_family_is_judged_by_the_geometry_of_its_shapes(reached, unseen, seed, learned):
    n = min(round(reached / SHAPES.spacing_m) + 3, POINTS + 2)
    rows, across, waves = SHAPES.within(reached, n)
    root, z, learned_of = drawn(seed, learned)
    root, learned_of = root[:, :n], learned_of[:n]
    root, z = np.linalg.qr(root)[1], z[:n]
    images = rows @ root.T
    least = float(np.quantile(np.sum(images[: 4 * across] ** 2, axis=1), unseen)) * (1.0 - 1e-9)
    bounds = product.Bounds(least, 1.3, 60.0)
    p_values, centre = product.scan(
        product.LookedFor(rows, across, waves),
        product.Scores(root.T @ root, root.T @ z, learned_of),
        bounds,
    )
    sphere = Sphere(rows, root, z, learned_of, bounds)
    level, tilt = sphere.v[-2], sphere.v[-1]
    tilted = tilt - level * (tilt @ level) / (level @ level)
    bump, place = sphere.bump(across, 4)
    expected = [sphere.single(level), sphere.single(tilted), bump, sphere.ripple(4 * across, waves)]
    assert p_values == pytest.approx(expected, rel=1e-6)
    assert centre == place


def test_shapes_are_the_functions_that_they_stand_for():
    """At the grid points, where cubic B-splines are 1/6, 4/6 and 1/6."""
    on_grid = np.zeros((POINTS, POINTS + 2))
    for k in range(POINTS):
        on_grid[k, k : k + 3] = np.array([1.0, 4.0, 1.0]) / 6.0
    for width, bumps in zip(deviation_shapes.BUMP_WIDTHS_M, SHAPES.bumps, strict=True):
        for centre, bump in zip(GRID, bumps, strict=True):
            assert on_grid @ bump == pytest.approx(np.exp(-(((GRID - centre) / width) ** 2) / 2.0), abs=1e-9)
    assert SHAPES.waves_m[0] == LENGTH
    for wave, (cosine, sine) in zip(SHAPES.waves_m, SHAPES.ripples, strict=True):
        turned = np.exp(2j * np.pi * GRID / wave)
        assert on_grid @ cosine == pytest.approx(turned.real, abs=1e-9)
        assert on_grid @ sine == pytest.approx(turned.imag, abs=1e-9)
    assert on_grid @ SHAPES.plain.T == pytest.approx(np.column_stack([np.ones(POINTS), GRID / LENGTH]))


def test_a_ripple_of_which_some_phase_is_not_seen_has_no_size():
    """Cycles that see one direction alone are blind to some phase of every wave."""
    to_coefficients = friction_profile.shape_coefficients(POINTS)
    seen = np.linalg.pinv(to_coefficients) @ np.cos(2.0 * np.pi * GRID / 1e-3)
    P = np.outer(seen, seen)
    blind = deviation_size.estimate_size(deviation_size.RIPPLE, P, 30.0 * seen, GRID, LENGTH, 1e-2, 1.0)
    assert blind == deviation_size.UNSEEN
    everything = P + np.eye(len(seen))
    size, std = deviation_size.estimate_size(
        deviation_size.RIPPLE, everything, 30.0 * seen, GRID, LENGTH, 1e-2, 1.0
    )
    assert 0.0 < std < size
