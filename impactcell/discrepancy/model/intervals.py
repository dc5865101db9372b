"""Intervals of the fitted parameters from the scatter between shots (sandwich, the shot as the cluster)."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.linearisation import Tangent
from impactcell.discrepancy.model.parameters import Coordinate
from impactcell.records import Samples

LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Estimate:
    """A parameter with its 95 % interval."""

    effect: str
    parameter: str
    batch: int
    value: float
    low: float
    high: float


def covariance(tangent: Tangent) -> Samples:
    """Covariance of the shared coordinates, shape (p, p).

    H^-1 (sum u_i u_i') H^-1 n/(n - p), with the leverage of every shot taken out of its own score
    (Bell and McCaffrey 2002), since with some forty shots the plain sandwich is too narrow.
    """
    H = tangent.information
    n, p = tangent.shot_gradient.shape
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    inverse = np.linalg.pinv(H / np.outer(scale, scale), rcond=1e-12, hermitian=True) / np.outer(scale, scale)
    meat = np.zeros((p, p))
    for i in range(n):
        share = tangent.shot_information[i] @ inverse
        corrected = np.linalg.lstsq(np.eye(p) - 0.98 * share, tangent.shot_gradient[i], rcond=None)[0]
        meat += np.outer(corrected, corrected)
    made: Samples = inverse @ meat @ inverse
    return made


def estimates(fit: Fit, tangent: Tangent) -> tuple[Estimate, ...]:
    """Every shared parameter with its interval."""
    shots = len(tangent.bounds) - 1
    spread = np.sqrt(np.maximum(np.diag(covariance(tangent)), 0.0))
    quantile = float(student.ppf(0.5 + 0.5 * LEVEL, max(shots - len(fit.at), 2)))
    made = []
    for coordinate, at, std in zip(fit.coordinates, fit.at, spread, strict=True):
        half = float(quantile * std)
        ends = sorted(_bounded(coordinate, float(at) + sign * half) for sign in (-1.0, 1.0))
        if coordinate.form == "angle":
            middle = coordinate.value(float(at))
            ends = [middle - coordinate.scale * half, middle + coordinate.scale * half]
        made.append(
            Estimate(
                coordinate.effect,
                coordinate.parameter,
                coordinate.batch,
                coordinate.value(float(at)),
                ends[0],
                ends[1],
            )
        )
    return tuple(made)


def _bounded(coordinate: Coordinate, at: float) -> float:
    return coordinate.value(min(max(at, coordinate.lower), coordinate.upper))
