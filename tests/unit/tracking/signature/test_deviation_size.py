"""Size of a deviation and its standard deviation against shapes of any place and width, drawn with noise."""

import math

import numpy as np
import pytest

from impactcell.tracking.signature import deviation_size, friction_profile

LENGTH_M, POINTS = 4e-3, 33
GRID = np.linspace(0.0, LENGTH_M, POINTS)
TO_COEFFICIENTS = np.linalg.pinv(friction_profile.on_grid(POINTS))
# as a slide sees it: the higher the wave the less
COSINES = np.cos(np.pi * np.outer(np.arange(POINTS + 2) + 0.5, np.arange(25)) / (POINTS + 2))
ROOT = COSINES * 2e3 / (1.0 + 0.3 * np.arange(25))
P = ROOT @ ROOT.T
SCALE = 1.3


def bell(x):
    return np.exp(-0.5 * x**2)


def cosine(x):
    return np.where(np.abs(x) < 2.355, 0.5 * (1.0 + np.cos(np.pi * x / 2.355)), 0.0)


def box(x):
    return 0.5 * (np.tanh((x + 1.1775) / 0.15) - np.tanh((x - 1.1775) / 0.15))


def bump(profile):
    def make(rng):
        place, width = rng.uniform(0.3e-3, 3.7e-3), math.exp(rng.uniform(math.log(0.2e-3), math.log(0.7e-3)))
        return profile((GRID - place) / width)

    return make


def ripple(rng):
    wave = math.exp(rng.uniform(math.log(0.55e-3), math.log(3e-3)))
    return np.cos(2.0 * math.pi * GRID / wave + rng.uniform(0.0, 6.28))


SHAPES = {
    "bell": (deviation_size.BUMP, bump(bell)),
    "cosine": (deviation_size.BUMP, bump(cosine)),
    "box": (deviation_size.BUMP, bump(box)),
    "ripple": (deviation_size.RIPPLE, ripple),
    "level": (deviation_size.LEVEL, lambda _: np.ones(POINTS)),
    "tilt": (deviation_size.TILT, lambda rng: GRID / LENGTH_M + rng.normal()),
}


def drawn(name, score, seed):
    """Size, standard deviation and true size of one shape, `score` times as large as its own noise."""
    rng = np.random.default_rng([seed, list(SHAPES).index(name)])
    family, make = SHAPES[name]
    s = TO_COEFFICIENTS @ make(rng)
    true = (
        score
        * math.sqrt(SCALE / (s @ P @ s))
        * (1.0 if family == deviation_size.RIPPLE else rng.choice([-1.0, 1.0]))
    )
    u = P @ s * true + math.sqrt(SCALE) * ROOT @ rng.normal(size=25)
    return (*deviation_size.estimate_size(family, P, u, GRID, LENGTH_M, 10.0, SCALE), true)


@pytest.mark.parametrize("score", [7.0, 20.0, 60.0])
@pytest.mark.parametrize("name", list(SHAPES))
def test_size_is_off_by_as_much_as_its_standard_deviation_says(name, score):
    found = np.array([drawn(name, score, seed) for seed in range(150)])
    off = (found[:, 0] - found[:, 2]) / found[:, 1] * np.sign(found[:, 2])
    low, middle, high = np.percentile(off, (15.87, 50.0, 84.13))
    assert 0.8 < (high - low) / 2.0 < 1.25
    assert abs(middle) < 0.6
    assert (np.abs(off) < 3.0).mean() > 0.96


def test_what_cannot_be_seen_has_no_size():
    for family in range(4):
        assert deviation_size.estimate_size(family, P, P[0], GRID, LENGTH_M, 1e12, 1.0) == (0.0, math.inf)


def test_a_short_slide_shows_the_size_of_a_bump_on_its_way():
    seen = TO_COEFFICIENTS.T[:, :17]
    s = (0.05 * bell((GRID - 1e-3) / 0.3e-3)) @ seen
    short = P[:17, :17]
    size, std = deviation_size.estimate_size(deviation_size.BUMP, short, short @ s, GRID, 1.7e-3, 10.0, 1.0)
    assert size == pytest.approx(0.05, rel=0.02)
    assert 0.0 < std < 0.005
