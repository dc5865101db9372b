"""What a shot's own numbers go with: an error of a record does not know which way or how hard was tapped."""

import math
from collections.abc import Sequence

import numpy as np

from impactcell.discrepancy.model.contact_moment import MIN_STEP_SHARE
from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.model.shot_parameters import STD_OF_TOLD
from impactcell.discrepancy.model.told_settings import CHANCE, correlation_chance
from impactcell.records import Samples

LEAST_SHARE = 0.1
"""Of the error with which a setting is known: less than this that goes with a covariate does not matter."""
_WORDS = {
    "onset_s": "first contact lay elsewhere than told",
    "log_velocity": "velocity were off what is told",
    "log_mass": "mass were off what is told",
}
_OWN = {"log_velocity": ("velocity", 6e4, "mm/min"), "log_mass": ("mass", 1.0, "kg")}
"""Covariate that is the number itself, and the unit in which it is told."""
AS_MUCH = 0.3
"""Of what a number is off by in the mean: where it scatters by less, it is off by as much in every shot."""


def dependence_notes(problem: Problem, fitted: Fit, names: Sequence[str]) -> tuple[str, ...]:
    """Say which of the shots' own numbers, by names, go with something that differs among the shots.

    By the chance of the closest correlation, shared among the covariates.
    """
    notes = []
    for name in names:
        found = _closest(problem, getattr(fitted.shot_parameters, name), _least(problem, name))
        if found is not None:
            covariate, r = found
            if covariate == _OWN.get(name, ("",))[0]:
                notes.append(_off_by(problem, name, getattr(fitted.shot_parameters, name)))
                continue
            notes.append(
                f"Nothing would remain if {_WORDS[name]}, shot by shot, but so it goes with {covariate} "
                f"(correlation {r:+.2f}), which no error of a record does."
            )
    return tuple(notes)


def _off_by(problem: Problem, name: str, off: Samples) -> str:
    """Say of a number whose error goes with itself by how much it is off, and whether in every shot alike."""
    covariate, unit, symbol = _OWN[name]
    told = unit * np.array([shot.covariates[covariate] for shot in problem.shots.items])
    more = told * np.expm1(off)
    mean, std = float(more.mean()), float(more.std())
    if std < AS_MUCH * abs(mean):
        return (
            f"Nothing would remain if {covariate} were {mean:+.3g} {symbol} off in every shot, whatever is "
            "told: a zero, or what was not weighed with it? Check it."
        )
    return (
        f"Nothing would remain if {covariate} were off by {mean:+.3g} {symbol} in the mean, {std:.2g} from "
        f"shot to shot, the more the larger or smaller it is: check how {covariate} was told."
    )


def _least(problem: Problem, name: str) -> float:
    """Return the standard deviation along a covariate from which on it matters."""
    if name in STD_OF_TOLD:
        return LEAST_SHARE * STD_OF_TOLD[name]
    return MIN_STEP_SHARE * float(np.median(problem.onset_step_s))


def _closest(problem: Problem, values: Samples, least: float) -> tuple[str, float] | None:
    """Return the covariate with the closest correlation and that, where it is no chance and matters."""
    items, count = problem.shots.items, len(values)
    if count < 4 or not float(values.std()) > least:
        return None
    found: list[tuple[float, str]] = []
    for name in items[0].covariates:
        row = np.array([shot.covariates.get(name, math.nan) for shot in items])
        if np.isfinite(row).all() and float(np.ptp(row)) > 0.0:
            found.append((float(np.corrcoef(row, values)[0, 1]), name))
    r, name = max(found, key=lambda one: abs(one[0]), default=(0.0, ""))
    is_chance = len(found) * correlation_chance(r, count - 1) > CHANCE
    return None if is_chance or abs(r) * float(values.std()) < least else (name, r)
