"""Where model and measurement disagree: a map of phases against covariates, tested as one family.

A cell of the map asks whether the residuals of one phase, on any channel and in any smooth shape along the
phase, have a mean that is not zero (column `all`) or that changes with a covariate. The row `between_shots`
asks the same of the friction factors. Every cell is a group of directions for `resample`.
"""

from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data.prepared_campaign import Material
from impactcell.discrepancy.data.shots import CHANNELS, Index
from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.linearisation import Products, Tangent, products, together
from impactcell.discrepancy.model.phases import BETWEEN_SHOTS, PHASES, course_of, phases, place_within
from impactcell.discrepancy.model.problem import Problem
from impactcell.records import Samples

ALL = "all"
FINE = 10
COARSE = 3
FEWEST_SAMPLES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Directions:
    """Directions of the map.

    Attributes
    ----------
    products : Products
    cell : ndarray, shape (Q,)
        Cell of each direction.
    rows, columns : tuple of str
        Phases and covariates; cell = row * len(columns) + column.
    channel : ndarray, shape (Q,)
        Channel of each direction, -1 for friction factors.
    place : ndarray, shape (Q,)
        Where within the phase the direction has its middle.
    """

    products: Products
    cell: Index
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    channel: Index
    place: Samples


def modulators(problem: Problem, material: Material) -> dict[str, Samples]:
    """Covariates of the problem's shots, centred and scaled; those that are constant are left out."""
    made: dict[str, Samples] = {}
    for name in material.covariates:
        values = np.array([shot.covariates[name] for shot in problem.shots.items])
        spread = float(values.std())
        if spread > 1e-12 * float(np.abs(values).max()):
            made[name] = (values - values.mean()) / spread
    return made


def directions(problem: Problem, fit: Fit, tangent: Tangent, material: Material) -> Directions:
    """Directions of every cell of the map."""
    course = course_of(problem, fit)
    times = problem.shots.times
    phase = phases(problem, course)
    place = place_within(problem, phase, times)
    factors = modulators(problem, material)
    columns = (ALL, *factors)
    parts: list[Products] = []
    cells: list[int] = []
    channels: list[int] = []
    places: list[float] = []
    rows: list[str] = []
    for number, name in enumerate(PHASES):
        inside = phase == number
        if not inside.any():
            continue
        row = len(rows)
        rows.append(name)
        for channel in range(len(CHANNELS)):
            mine = inside & (problem.shots.channel == channel)
            if int(mine.sum()) < FEWEST_SAMPLES * problem.count:
                continue
            for count, modulated in ((FINE, False), (COARSE, True)):
                for middle, hat in _hats(place, mine, count):
                    made = products(tangent, hat)
                    for column, covariate in enumerate(columns):
                        if (column == 0) == modulated:
                            continue
                        parts.append(made if column == 0 else made.modulated(factors[covariate]))
                        cells.append(row * len(columns) + column)
                        channels.append(channel)
                        places.append(middle)
    row = len(rows)
    rows.append(BETWEEN_SHOTS)
    unit = products(tangent, np.zeros(problem.shots.values.size), np.ones(problem.count))
    for column, covariate in enumerate(columns):
        if column:
            parts.append(unit.modulated(factors[covariate]))
            cells.append(row * len(columns) + column)
            channels.append(-1)
            places.append(0.5)
    return Directions(
        together(parts), np.array(cells), tuple(rows), columns, np.array(channels), np.array(places)
    )


def _hats(place: Samples, mine: Index, count: int) -> list[tuple[float, Samples]]:
    """Piecewise linear functions of the place within the phase that add up to one."""
    made = []
    for knot in np.linspace(0.0, 1.0, count):
        hat = np.maximum(1.0 - np.abs(place - knot) * (count - 1), 0.0)
        made.append((float(knot), np.where(mine, hat, 0.0)))
    return made
