"""What is learned of the variation between cycles against the truth it was drawn from; tails of the scan."""

import math

import numpy as np
import pytest

from impactcell.tracking.signature import deviation_shapes, matched_filter_scan, pca_variation

COEFFICIENTS = 35
MODES = pca_variation.cosines(COEFFICIENTS)


def information(level):
    return level * np.eye(COEFFICIENTS)


def sums_of(variation):
    return pca_variation.Sums(*variation.sums)


def learned(true_sizes, cycles, seed):
    """First guess, and Lambda of cycles whose modes vary by `true_sizes` of it, far above their noise."""
    rng = np.random.default_rng(seed)
    first = pca_variation.initial_guess(0.2)
    sums, basis = sums_of(first), first.scale * MODES
    G = information(1e8)
    for _ in range(cycles):
        deviation = basis @ (np.array(true_sizes) * rng.normal(size=pca_variation.MODES))
        vector = G @ deviation + 1e4 * rng.normal(size=COEFFICIENTS)
        sums = pca_variation.update_sums(basis, G, vector, 1e12, sums)
    return first, pca_variation.covariance(sums, cycles)


@pytest.mark.slow
def test_sizes_of_the_modes_are_found_without_bias():
    sizes = [1.0, 0.4, 0.2, 0.0, 0.0, 0.0]
    ratios = [np.diag(learned(sizes, 60, seed)[1])[:3] / np.square(sizes[:3]) for seed in range(20)]
    # 20 x 60 cycles: a variance is known to sqrt(2 / 1200), four times that is allowed
    assert np.mean(ratios, axis=0) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / 1200.0))


def test_modes_that_do_not_vary_are_zero():
    first, spread = learned([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 400, 3)
    noise = 1.0 / (1e8 * COEFFICIENTS * first.scale**2)
    assert (np.diag(spread)[1:] < 0.3 * noise[1:]).all()


def test_what_was_never_seen_keeps_the_first_guess():
    first = pca_variation.initial_guess(0.2)
    sums = sums_of(first)
    for _ in range(50):
        sums = pca_variation.update_sums(MODES, information(0.0), np.zeros(COEFFICIENTS), 100.0, sums)
    assert pca_variation.covariance(sums, 50) == pytest.approx(np.eye(pca_variation.MODES))


def test_precise_cycles_are_not_judged_by_what_noisy_ones_leave_unknown():
    """Half of the cycles are ten times noisier, as after taps of another velocity; only the level varies."""
    precise, noisy, level, odd = 0.01, 0.1, 0.05, []
    unit = np.eye(pca_variation.MODES)
    for seed in range(20):
        rng, first = np.random.default_rng(seed), pca_variation.initial_guess(0.2)
        sums = sums_of(first)

        def drawn(noise, rng=rng):
            return level * rng.normal() * unit[0] + noise * rng.normal(size=pca_variation.MODES)

        for cycle in range(60):
            noise = precise if cycle % 2 else noisy
            sums = pca_variation.update_sums(unit, unit / noise**2, drawn(noise) / noise**2, 1e12, sums)
        covariance = pca_variation.covariance(sums, 60) + precise**2 * unit
        scores = np.array([drawn(precise) for _ in range(400)])
        distances = np.einsum("ni,ij,nj->n", scores, np.linalg.inv(covariance), scores)
        odd.append(np.mean(distances > 22.46))  # one in a thousand of chi squared with six degrees of freedom
    assert np.mean(odd) < 2e-3


def test_components_are_the_principal_ones_of_the_covariance():
    root = np.random.default_rng(2).normal(size=(pca_variation.MODES, pca_variation.MODES))
    found = pca_variation.components(root @ root.T, MODES)
    assert found @ found.T == pytest.approx(MODES @ root @ root.T @ MODES.T)
    sizes = np.linalg.norm(np.linalg.pinv(MODES) @ found, axis=0)
    assert sizes == pytest.approx(np.linalg.svd(root, compute_uv=False))


def test_tail_of_every_family_against_drawn_normal_scores():
    rows, across, waves = deviation_shapes.deviation_shapes(4e-3, 33).within(4e-3, COEFFICIENTS)
    rng = np.random.default_rng(1)
    # as a slide sees it: the higher the wave the less
    cosines = np.cos(np.pi * np.outer(np.arange(COEFFICIENTS) + 0.5, np.arange(20)) / COEFFICIENTS)
    root = cosines * 1e4 / (1.0 + np.arange(20)) ** 2
    P, C = root @ root.T, np.zeros((COEFFICIENTS, 1))
    n, level = 3000, 0.02
    counts = dict.fromkeys(("level", "tilt", "bump", "ripple"), 0)
    for _ in range(n):
        p_values, _ = matched_filter_scan.scan(
            matched_filter_scan.LookedFor(rows, across, waves),
            matched_filter_scan.Scores(P, root @ rng.normal(size=20), C),
            matched_filter_scan.Bounds(3000.0, 1.0, 1e9),
        )
        for name, p_value in zip(matched_filter_scan.FAMILIES, p_values, strict=True):
            counts[name] += p_value < level
    spread = 4.0 * math.sqrt(level / n)
    for name in ("level", "tilt"):
        assert counts[name] / n == pytest.approx(level, abs=spread)
    for name in ("bump", "ripple"):
        assert 0.3 * level < counts[name] / n < level + spread
