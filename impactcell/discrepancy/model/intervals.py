"""Intervals of the fitted parameters from the scatter between shots (sandwich, the shot as the cluster)."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.linearisation import LinearisedFit
from impactcell.discrepancy.model.parameters import Coordinate
from impactcell.records import Samples

CONFIDENCE_LEVEL = 0.95
"""Probability with which intervals are to cover: `ci95` of `result.json`."""
UNSEEN_SHARE = 1e-24
"""Information on a coordinate, over the largest, below which it is rounding: no shot changes with it."""
MAX_LEVERAGE = 0.98
"""Share of a shot's leverage that is taken out of its score, so that none divides by zero."""

SHOTS_OF_NOISE = 4.0
"""Shots that the variance by noise alone counts as, beside those that show what they scatter by."""


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
    """A parameter with its 95 % interval.

    Attributes
    ----------
    at_bound : bool
        The interval ends at a bound of the parameter's range: it is that bound, not an end that data give.
    """

    effect: str
    parameter: str
    batch: int
    value: float
    low: float
    high: float
    at_bound: bool


@dataclass(frozen=True, slots=True, eq=False)
class SharedError:
    """What all shots have in common of the error of a model: smooth shapes of random size.

    Attributes
    ----------
    shapes : ndarray, shape (Q, p)
        Products of each shape with the derivatives by the shared coordinates, summed over the shots.
    variance : ndarray, shape (Q,)
        Of the shapes' sizes.
    """

    shapes: Samples
    variance: Samples


def variances(
    linearisation: LinearisedFit, shared_error: SharedError | None = None, penalty: Samples | None = None
) -> Samples:
    """Variance of each shared coordinate, shape (p,).

    The diagonal of H^-1 (sum u_i u_i') H^-1, with the leverage of every shot taken out of its own score
    (Bell and McCaffrey 2002), since with some forty shots the plain sandwich is too narrow. What few shots
    tell of has few such scores, and of a single shot the score is nought: with w_i the part of shot i in the
    variance that noise alone gives, they are worth (sum w_i)^2 / sum w_i^2 shots. So the variance is
    drawn towards that which noise alone gives, at the level of the residuals where that is above one, as if
    `SHOTS_OF_NOISE` more shots had shown it (Smyth 2004). What all shots have in common does not scatter
    between them: shapes s_q of variance c_q add sum c_q (H^-1 s_q)^2. A penalty theta' P theta, shape (p, p),
    adds P to H. What no shot tells of at all has no end.
    """
    H = linearisation.information if penalty is None else linearisation.information + penalty
    seen = np.diag(H) > UNSEEN_SHARE * float(np.diag(H).max(initial=0.0))
    H = H[np.ix_(seen, seen)]
    n, p = len(linearisation.shot_gradient), len(H)
    inverse = inverse_of(H)
    between_shots, parts = np.zeros(p), np.zeros((n, p))
    for i in range(n):
        share = linearisation.shot_information[i][np.ix_(seen, seen)] @ inverse
        gradient = linearisation.shot_gradient[i][seen]
        score = np.linalg.lstsq(np.eye(p) - MAX_LEVERAGE * share, gradient, rcond=None)
        between_shots += (inverse @ score[0]) ** 2
        parts[i] = np.einsum("ab,ba->a", inverse, share)
    noise = parts.sum(0)
    shots = 1.0 / np.maximum(((parts / np.maximum(noise, 1e-300)) ** 2).sum(0), 1.0 / n)
    level = max(linearisation.mean_squared_residual, 1.0)
    variance = np.full(len(seen), math.inf)
    variance[seen] = (shots * between_shots + SHOTS_OF_NOISE * level * noise) / (shots + SHOTS_OF_NOISE)
    if shared_error is not None:
        variance[seen] += shared_error.variance @ (shared_error.shapes[:, seen] @ inverse) ** 2
    return variance


def inverse_of(information: Samples) -> Samples:
    """Inverse of an information matrix, shape (p, p), whose coordinates have scales of their own."""
    scale = np.sqrt(np.diag(information))
    scales = np.outer(scale, scale)
    inverse: Samples = np.linalg.pinv(information / scales, rcond=1e-12, hermitian=True) / scales
    return inverse


def estimate_parameters(
    fit: Fit,
    linearisation: LinearisedFit,
    shared_error: SharedError | None = None,
    penalty: Samples | None = None,
) -> tuple[ParameterEstimate, ...]:
    """Every shared parameter with its interval; a penalty is that of the fit, shape (p, p)."""
    spread = np.sqrt(variances(linearisation, shared_error, penalty))
    quantile = interval_quantile(fit, linearisation, penalty)
    parameter_estimates = []
    for coordinate, theta, std in zip(fit.coordinates, fit.theta, spread, strict=True):
        half = float(quantile * std)
        ends = sorted(_clipped_value(coordinate, float(theta) + sign * half) for sign in (-1.0, 1.0))
        at_bound = not coordinate.lower < float(theta) - half <= float(theta) + half < coordinate.upper
        if coordinate.form == "angle":
            middle = coordinate.value(float(theta))
            ends = [middle - coordinate.scale * half, middle + coordinate.scale * half]
        parameter_estimates.append(
            ParameterEstimate(
                coordinate.effect,
                coordinate.parameter,
                coordinate.batch,
                coordinate.value(float(theta)),
                ends[0],
                ends[1],
                at_bound,
            )
        )
    return tuple(parameter_estimates)


def interval_quantile(fit: Fit, linearisation: LinearisedFit, penalty: Samples | None = None) -> float:
    """Half of an interval over the standard deviation: Student's t of as many shots as no parameter takes.

    Penalised coordinates take none: a shot has many more samples than they are.
    """
    numbers = len(fit.theta) if penalty is None else int((np.diag(penalty) == 0.0).sum())
    shots = len(linearisation.bounds) - 1
    return float(student.ppf(0.5 + 0.5 * CONFIDENCE_LEVEL, max(shots - numbers, 2)))


def _clipped_value(coordinate: Coordinate, theta: float) -> float:
    return coordinate.value(min(max(theta, coordinate.lower), coordinate.upper))
