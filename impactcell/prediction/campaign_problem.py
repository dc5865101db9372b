"""Least squares of all taps of a campaign: what they share, and what each has of its own, eliminated.

Shared are mu_k/mu_s, k and b, and how far mass, velocity and the sensors' scales are off in all taps alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.errors import NotConvergedError, PhysicsError
from impactcell.prediction import gauss_newton
from impactcell.prediction.block_residuals import Linearisation
from impactcell.prediction.gauss_newton import Step, StopRule, step_within
from impactcell.prediction.linearised_model import (
    DAMPING,
    FARTHEST,
    MU_K,
    PARAMETERS,
    RATIO,
    STIFFNESS,
    WITH_RECORDER,
    LinearisedModel,
)
from impactcell.records import Samples

COMMON = np.arange(WITH_RECORDER, WITH_RECORDER + 4)
"""Places, behind a tap's theta, of what all taps have in common of mass, velocity and scales."""
SHARED = np.array([RATIO, STIFFNESS, DAMPING, *COMMON])
"""Parameters that all taps share: mu_k/mu_s, k and b, and these."""
OF_A_TAP = np.array([1.0, 0.2, 0.2, 0.02, 0.02])
"""How far contact is from t = 0, and mass, velocity and scales of a tap from what all have in common, in
standard deviations of what is known: a balance, a drive and a sensor are off alike in all taps."""
WEIGHT = 1.0 / OF_A_TAP
PLANT, BESIDE = slice(0, DAMPING - RATIO + 1), slice(DAMPING - RATIO + 1, None)
"""Those of the plant among them, and the others."""
STOP = StopRule(max_steps=40, length=0.02, cost=0.05, refused_cost=0.1)
"""When the joint fit ends; its cost is of all taps, ten and more."""
MAX_STEP = np.array([0.3, 0.3, 0.3, 4.0, 4.0, 4.0, 4.0])
"""Longest step of what is shared: farther away the linear model says nothing."""
HELD = 1e-6
"""Standard deviation of ln(mu_k/mu_s) that holds it where it is."""
LEAST_RISE = 2.0
"""Rise of the sum of squares at two standard deviations, 4 where it is quadratic, below which it is flat."""
NO_REST = (
    "the plant could not be fitted to the campaign: no k, b and mu_k/mu_s explain its taps; see that stroke, "
    "masses and t = 0, first contact, are right, or give --cell; `discrepancy` says what a model lacks"
)
"""What is said where the steps of a joint fit come to no end."""


@dataclass(frozen=True, slots=True, eq=False)
class CampaignPoint:
    """Parameters of every tap, shape (n, 13), the linear model of each, and half of their sums of squares."""

    theta: Samples
    taps: list[Linearisation]
    cost: float


@dataclass(frozen=True, slots=True, eq=False)
class CampaignFit:
    """Parameters of every tap, covariance of the shared ones, sum of squares, and whether the steps ended."""

    theta: Samples
    covariance: Samples
    chi2: float
    is_at_rest: bool


@dataclass(frozen=True, slots=True, eq=False)
class CampaignProblem:
    """The shared parameters, held to `anchor` within `spread`, and every tap's own, which are eliminated."""

    responses: Sequence[LinearisedModel]
    anchor: Samples
    spread: Samples

    def fit(self, initial_guess: Samples) -> CampaignFit:
        """Go from a guess to the minimum."""
        minimum, step, is_at_rest = gauss_newton.fit(self, initial_guess, STOP)
        return CampaignFit(minimum.theta, step.covariance, 2.0 * minimum.cost, is_at_rest)

    def ratio_std(self, fitted: CampaignFit) -> float:
        """Give the standard deviation of ln(mu_k/mu_s), as far as residuals really rise to either side.

        A tap that moves at once shows nothing of mu_s: where few taps stick, and those only just, the
        curvature is that of one side of a wall, and beyond the kink lies level ground (a profile likelihood,
        as by Murphy and van der Vaart 2000).
        """
        std = float(np.sqrt(fitted.covariance[0, 0]))
        return max(self._half_width(fitted, std), self._half_width(fitted, -std))

    def _half_width(self, fitted: CampaignFit, std: float) -> float:
        """Double a standard deviation until two of it make a difference, with all else fitted anew."""
        while abs(std) < self.spread[0]:
            moved = fitted.theta.copy()
            moved[:, RATIO] += 2.0 * std
            held = CampaignProblem(self.responses, moved[0, SHARED], np.append(HELD, self.spread[1:]))
            try:
                rise = held.fit(moved).chi2 - fitted.chi2
            except PhysicsError:  # no part moves so
                return abs(std)
            if rise >= LEAST_RISE:
                return abs(std)
            std *= 2.0
        return float(self.spread[0])

    def linearise(self, theta: Samples) -> CampaignPoint:
        """Linearise the model of every tap."""
        taps = [
            response.linearise(row[: response.parameters])
            for response, row in zip(self.responses, theta, strict=True)
        ]
        apart, common = _from_common(theta)
        beside = float(np.sum(apart**2)) + float(common @ common)
        return CampaignPoint(theta, taps, 0.5 * (sum(tap.chi2 for tap in taps) + beside))

    def step(self, start: CampaignPoint, damping: float) -> Step:
        """Solve for the shared parameters; each tap's own follow them."""
        prior = np.diag(1.0 / self.spread**2)
        curvature, gradient = prior.copy(), prior @ (start.theta[0, SHARED] - self.anchor)
        apart, _ = _from_common(start.theta)
        eliminated = []
        for tap, beside in zip(start.taps, apart, strict=True):
            parameters = len(tap.slope)
            own = np.array([MU_K, *range(PARAMETERS, parameters)])
            plant = SHARED[PLANT]
            inside, slope = tap.normal[np.ix_(own, own)].copy(), tap.slope[own].copy()
            cross = np.zeros((len(own), len(SHARED)))
            cross[:, PLANT] = tap.normal[np.ix_(own, plant)]
            shared, pull = np.zeros_like(curvature), np.zeros(len(SHARED))
            shared[PLANT, PLANT], pull[PLANT] = tap.normal[np.ix_(plant, plant)], tap.slope[plant]
            if parameters > PARAMETERS:
                inside[1:, 1:] += np.diag(WEIGHT**2)
                slope[1:] += WEIGHT * beside
                cross[2:, BESIDE] -= np.diag(WEIGHT[1:] ** 2)
                shared[BESIDE, BESIDE] += np.diag(WEIGHT[1:] ** 2)
                pull[BESIDE] -= WEIGHT[1:] * beside[1:]
            if not inside[0, 0] > 0.0:
                raise NotConvergedError(NO_REST)  # the friction of a tap does not show in its samples
            followed, moved = np.linalg.solve(inside, cross), np.linalg.solve(inside, slope)
            curvature += shared - cross.T @ followed
            gradient += pull - cross.T @ moved
            eliminated.append((own, followed, moved))
        damped = curvature + damping * np.diag(np.diag(curvature))
        step = -np.linalg.solve(damped, gradient)
        length = float(step @ curvature @ step)
        step = step_within(step, np.asarray(np.linalg.inv(damped)), -MAX_STEP, MAX_STEP)
        theta = start.theta.copy()
        theta[:, SHARED] += step
        for row, (own, followed, moved) in zip(theta, eliminated, strict=True):
            row[own] -= moved + followed @ step
        theta[:, PARAMETERS:WITH_RECORDER] = np.clip(theta[:, PARAMETERS:WITH_RECORDER], -FARTHEST, FARTHEST)
        return Step(theta, length, np.asarray(np.linalg.inv(curvature)))

    def noise(self, at: CampaignPoint) -> float:  # noqa: ARG002  # what a misfit adds is weighed afterwards
        """Give 1: steps end by the sensors' noise, whatever the model misses."""
        return 1.0


def _from_common(theta: Samples) -> tuple[Samples, Samples]:
    """Contact, mass, velocity and scales of each tap, from what all have in common, and this.

    Returns
    -------
    apart : ndarray, shape (n, 5)
        In standard deviations of each.
    common : ndarray, shape (4,)
    """
    common = theta[0, COMMON]
    return (theta[:, PARAMETERS:WITH_RECORDER] - np.append(0.0, common)) * WEIGHT, common
