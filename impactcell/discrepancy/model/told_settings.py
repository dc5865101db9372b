"""Velocity and mass of a shot: as told, or, since they were measured, a little off in every shot."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from impactcell.discrepancy.data import FORCE, PreparedShot
from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.model.shot_fits import shot_equations
from impactcell.discrepancy.model.shot_parameters import STD_OF_TOLD
from impactcell.records import Samples

SETTINGS = tuple(STD_OF_TOLD)
"""What may be open, by its name among the shots' own numbers."""
FEWEST_TO_SEE = 6
"""Degrees of freedom of a scatter among like shots from which on it is looked at."""
MIN_ERRORS = 5.0
"""A scatter is seen from so many of its errors on: what a model lacks made 4.6 of them at most by itself, but
for static friction that goes with dwell, an effect that acts between shots; correlated noise made 6."""
CHANCE = 1e-3
"""A scatter that goes with something else of the shots by less than this chance is not of the setting."""
PLAUSIBLE_STD = 3.0
"""Root mean square, in standard deviations of what is told, up to which a setting may be told wrong."""
ROUNDING = 1e-9
"""Relative difference among like shots that is none."""
_WORDS = {"log_velocity": "Velocity", "log_mass": "Mass"}
_LIKE = {"log_velocity": "", "log_mass": "; a force whose scale is off looks the same"}


@dataclass(frozen=True, slots=True)
class SettingScatter:
    """How a setting scatters among shots that are told to be alike.

    Attributes
    ----------
    std, error : float
        Relative standard deviation, nan without replicates, and what noise makes of it by the gap there is.
    degrees_of_freedom : int
    chance : float
        Of going so closely with anything else that differs among like shots, friction included.
    """

    std: float
    error: float
    degrees_of_freedom: int
    chance: float

    @property
    def is_seen(self) -> bool:
        """Whether it scatters, and by itself."""
        enough = self.degrees_of_freedom >= FEWEST_TO_SEE
        return enough and self.std > MIN_ERRORS * self.error and self.chance > CHANCE


def with_open_settings(items: Sequence[PreparedShot], names: Sequence[str]) -> tuple[PreparedShot, ...]:
    """Open velocity, mass or both of shots that tell them.

    Motion alone shows mass over stiffness only: without a force a mass stays as told.
    """
    return tuple(
        replace(
            shot,
            velocity_is_open="log_velocity" in names,
            mass_is_open="log_mass" in names and math.isfinite(shot.mass_kg) and bool(shot.times[FORCE].size),
        )
        for shot in items
    )


def settings_on_average(problem: Problem, model: Fit) -> Problem:
    """Tell shots what a model has found their settings to be off in the mean, and open none."""
    velocity, mass = (math.exp(float(_of_open(model, name).mean())) for name in SETTINGS)
    items = tuple(
        replace(shot, velocity_m_s=velocity * shot.velocity_m_s, mass_kg=mass * shot.mass_kg)
        if shot.velocity_is_open or shot.mass_is_open
        else shot
        for shot in problem.shots.items
    )
    shots = replace(problem.shots, items=with_open_settings(items, ()))
    return Problem(shots, problem.batches, problem.effects, problem.constraints)


def setting_scatter(problem: Problem, fitted: Fit) -> dict[str, SettingScatter]:
    """Scatter of velocity and mass about those of like shots, by one step from where they are as told.

    What a model lacks moves them as well, but alike in like shots, or with what differs among them.
    """
    shots = replace(problem.shots, items=with_open_settings(problem.shots.items, SETTINGS))
    model = Problem(shots, problem.batches, fitted.effects, problem.constraints)
    equations = shot_equations(model, fitted.state)
    steps = equations.steps(np.empty(0))
    gap = max(math.sqrt(float(fitted.residual @ fitted.residual) / fitted.residual.size), 1.0)
    rows = np.array([fitted.shot_parameters.log_factor + steps[:, 0], *_covariates(shots.items)])
    group = np.array([shot.group for shot in shots.items])
    found = {}
    for name in (name for name in SETTINGS if name in model.shot_parameter_names):
        column = model.shot_parameter_names.index(name)
        those = model.freedom.is_open[name]
        _, member = np.unique(group[those], return_inverse=True)
        degrees_of_freedom = len(member) - int(member.max()) - 1
        beside = [_within(row[those], member) for row in rows]
        own = _within(steps[those, column], member)
        found[name] = SettingScatter(
            math.sqrt(float(own @ own) / degrees_of_freedom) if degrees_of_freedom else math.nan,
            math.sqrt(float(np.median(equations.inverse[those, column, column]))) * gap,
            degrees_of_freedom,
            _chance(own, beside, degrees_of_freedom),
        )
    return found


def correlation_chance(r: float, degrees_of_freedom: int) -> float:
    """Chance of a correlation as close as r, either way: t = r sqrt((n - 1) / (1 - r²)) (Student).

    Parameters
    ----------
    degrees_of_freedom : int
        n of the values, their mean or means taken away.
    """
    r = min(abs(r), 1.0 - 1e-12)
    t = r * math.sqrt((degrees_of_freedom - 1) / (1.0 - r * r))
    return 2.0 * float(stats.t.sf(t, degrees_of_freedom - 1))


def setting_notes(fitted: Fit, names: Sequence[str], *, remains: bool = False) -> tuple[str, ...]:
    """Say of each of some settings by how much it is off; where something remains, how it comes out."""
    if remains:
        return tuple(
            f"{_WORDS[name]} is fitted shot by shot and comes out off what is told by {_off(fitted, name)}; "
            "that may be what the model lacks."
            for name in names
        )
    return tuple(
        f"{_WORDS[name]} is off what is told by {_off(fitted, name)}"
        + ("" if _is_plausible(fitted, name) else f", {_more_than(name)}")
        + f": it is fitted shot by shot{_LIKE[name]}."
        for name in names
    )


def implausible_notes(fitted: Fit, names: Sequence[str]) -> tuple[str, ...]:
    """Say which of some settings would have to be farther off than they may be told."""
    return tuple(
        f"Nothing would remain if {_WORDS[name].lower()} were off what is told by {_off(fitted, name)}, "
        f"{_more_than(name)}: check it."
        for name in names
        if not _is_plausible(fitted, name)
    )


def _more_than(name: str) -> str:
    limit = 100.0 * PLAUSIBLE_STD * STD_OF_TOLD[name]
    return f"more than the {limit:g} % that is put down to how it was measured"


def _off(fitted: Fit, name: str) -> str:
    off = 100.0 * np.expm1(_of_open(fitted, name))
    return f"{off.mean():+.2f} % in the mean, {off.std():.2f} % from shot to shot"


def _of_open(fitted: Fit, name: str) -> Samples:
    """Values of the shots that are open, which a fit has moved; one 0 where there are none."""
    values: Samples = getattr(fitted.shot_parameters, name)
    return values[values != 0.0] if values.any() else values[:1]


def _is_plausible(fitted: Fit, name: str) -> bool:
    deviation = _of_open(fitted, name)
    return math.sqrt(float(np.mean(deviation**2))) < PLAUSIBLE_STD * STD_OF_TOLD[name]


def _covariates(items: Sequence[PreparedShot]) -> list[Samples]:
    names = [name for name in items[0].covariates if name not in {"velocity", "mass"}]
    rows = [np.array([shot.covariates.get(name, math.nan) for shot in items]) for name in names]
    return [row for row in rows if np.isfinite(row).all()]


def _within(values: Samples, member: np.ndarray) -> Samples:
    """Take the mean of like shots away."""
    within: Samples = values - (np.bincount(member, values) / np.bincount(member))[member]
    within[np.abs(within) < ROUNDING * float(np.abs(values).max(initial=0.0))] = 0.0
    return within


def _chance(own: Samples, beside: Sequence[Samples], degrees_of_freedom: int) -> float:
    """Chance of the closest correlation with any of the rows, shared among them."""
    chances = []
    for row in beside:
        size = math.sqrt(float(row @ row) * float(own @ own))
        if degrees_of_freedom < 2 or not size > 0.0:
            continue
        chances.append(correlation_chance(float(row @ own) / size, degrees_of_freedom))
    return min(1.0, len(chances) * min(chances)) if chances else 1.0
