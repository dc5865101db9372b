"""What is learned of the variation between cycles against the truth it was drawn from; tails of the scan."""

import math

import numpy as np
import pytest

from impactcell.tracking import scan, shapes, variation

COEFFICIENTS = 35


def information(level):
    return level * np.eye(COEFFICIENTS)


def learned(true_sizes, cycles, seed):
    """Cycles whose modes vary by `true_sizes`, in units of the first guess, far above the noise of each."""
    rng = np.random.default_rng(seed)
    found = variation.guess(0.2)
    basis = variation.cosines(COEFFICIENTS) * found.scale
    G = information(1e8)
    for _ in range(cycles):
        deviation = basis @ (np.array(true_sizes) * rng.normal(size=variation.MODES))
        vector = G @ deviation + 1e4 * rng.normal(size=COEFFICIENTS)
        found = variation.learn(found, G, vector, 1e12, COEFFICIENTS)
    return found


def test_sizes_of_the_modes_are_found_without_bias():
    sizes = [1.0, 0.4, 0.2, 0.0, 0.0, 0.0]
    ratios = [np.diag(learned(sizes, 60, seed).spread)[:3] / np.square(sizes[:3]) for seed in range(20)]
    # 20 x 60 cycles: a variance is known to sqrt(2 / 1200), four times that is allowed
    assert np.mean(ratios, axis=0) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / 1200.0))


def test_modes_that_do_not_vary_are_zero():
    found = learned([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 400, 3)
    noise = 1.0 / (1e8 * COEFFICIENTS * found.scale**2)
    assert (np.diag(found.spread)[1:] < 0.3 * noise[1:]).all()


def test_what_was_never_seen_keeps_the_first_guess():
    found = variation.guess(0.2)
    for _ in range(50):
        found = variation.learn(found, information(0.0), np.zeros(COEFFICIENTS), 100.0, COEFFICIENTS)
    assert found.spread == pytest.approx(np.eye(variation.MODES))


def test_tail_of_every_family_against_drawn_normal_scores():
    looked = shapes.shapes(4e-3, 33)
    rng = np.random.default_rng(1)
    # as a slide sees it: the higher the wave the less
    waves = np.cos(np.pi * np.outer(np.arange(COEFFICIENTS) + 0.5, np.arange(20)) / COEFFICIENTS)
    root = waves * 1e4 / (1.0 + np.arange(20)) ** 2
    P, C = root @ root.T, np.zeros((COEFFICIENTS, 1))
    n, level = 3000, 0.02
    counts = dict.fromkeys(("level", "tilt", "bump", "ripple"), 0)
    for _ in range(n):
        found, _ = scan.scan(looked, P, root @ rng.normal(size=20), C, 4e-3, 3000.0, 1.0, 1e9)
        for name, (p_value, _, _) in found.items():
            counts[name] += p_value < level
    spread = 4.0 * math.sqrt(level / n)
    for name in ("level", "tilt"):
        assert counts[name] / n == pytest.approx(level, abs=spread)
    for name in ("bump", "ripple"):
        assert 0.3 * level < counts[name] / n < level + spread
