"""Where model and measurement disagree: a map of phases against covariates, tested as one family.

A cell of the map asks whether the residuals of one phase, on any channel and in any smooth shape along the
phase, have a mean that is not zero (column `all`) or that changes with a covariate. Places count along the
tap: what a part does too much of whichever way it is tapped is alike in all shots. The row `between_shots`
asks the same of the friction factors. Every cell is a group of directions for `wild_bootstrap`.
"""

from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data import (
    BETWEEN_SHOTS,
    CHANNELS,
    FORCE,
    PHASES,
    IndexArray,
    PreparedCampaign,
)
from impactcell.discrepancy.model import (
    DirectionProducts,
    Fit,
    LinearisedFit,
    Problem,
    concatenate_products,
    direction_products,
    phase_positions,
    sample_phases,
    trajectory_of,
)
from impactcell.records import Samples

ALL = "all"
"""Column of the map for a mean over all shots."""
MEAN_KNOTS = 10
"""Knots along a phase of a shape that all shots share."""
COVARIATE_KNOTS = 3
"""Knots of a shape that a covariate multiplies: shots are fewer than samples."""
MIN_SAMPLES_PER_SHOT = 4
"""Samples of a phase and channel, a shot on average, from which on they are tested."""


@dataclass(frozen=True, slots=True, eq=False)
class MapDirections:
    """Directions of the map.

    Attributes
    ----------
    products : DirectionProducts
    cell : ndarray, shape (Q,)
        Cell of each direction.
    rows, columns : tuple of str
        Phases and covariates; cell = row * len(columns) + column.
    channel : ndarray, shape (Q,)
        Channel of each direction, -1 for friction factors.
    place : ndarray, shape (Q,)
        Where within the phase the direction has its middle.
    """

    products: DirectionProducts
    cell: IndexArray
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    channel: IndexArray
    place: Samples


def standardised_covariates(problem: Problem, prepared: PreparedCampaign) -> dict[str, Samples]:
    """Covariates of the problem's shots, centred and scaled; those that are constant are left out."""
    standardised: dict[str, Samples] = {}
    for name in prepared.covariates:
        values = np.array([shot.covariates[name] for shot in problem.shots.items])
        spread = float(values.std())
        if spread > 1e-12 * float(np.abs(values).max()):
            standardised[name] = (values - values.mean()) / spread
    return standardised


def map_directions(
    problem: Problem, fit: Fit, linearisation: LinearisedFit, prepared: PreparedCampaign
) -> MapDirections:
    """Directions of every cell of the map."""
    trajectory = trajectory_of(problem, fit)
    times = problem.shots.times
    phase = sample_phases(problem, trajectory)
    place = phase_positions(problem, phase, times)
    along = np.repeat([float(shot.direction) for shot in problem.shots.items], problem.sizes)
    factors = standardised_covariates(problem, prepared)
    columns = (ALL, *factors)
    parts: list[DirectionProducts] = []
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
            in_channel = inside & (problem.shots.channel == channel)
            if int(in_channel.sum()) < MIN_SAMPLES_PER_SHOT * problem.count:
                continue
            for count, modulated in ((MEAN_KNOTS, False), (COVARIATE_KNOTS, True)):
                for middle, hat in _hat_functions(place, in_channel, count):
                    shape = hat if channel == FORCE else along * hat
                    hat_products = direction_products(linearisation, shape)
                    for column, covariate in enumerate(columns):
                        if (column == 0) == modulated:
                            continue
                        parts.append(
                            hat_products if column == 0 else hat_products.modulate(factors[covariate])
                        )
                        cells.append(row * len(columns) + column)
                        channels.append(channel)
                        places.append(middle)
    row = len(rows)
    rows.append(BETWEEN_SHOTS)
    unit = direction_products(linearisation, np.zeros(problem.shots.values.size), np.ones(problem.count))
    for column, covariate in enumerate(columns):
        if column:
            parts.append(unit.modulate(factors[covariate]))
            cells.append(row * len(columns) + column)
            channels.append(-1)
            places.append(0.5)
    return MapDirections(
        concatenate_products(parts),
        np.array(cells),
        tuple(rows),
        columns,
        np.array(channels),
        np.array(places),
    )


def _hat_functions(place: Samples, inside: IndexArray, count: int) -> list[tuple[float, Samples]]:
    """Piecewise linear functions of the place within the phase that add up to one."""
    hats = []
    for knot in np.linspace(0.0, 1.0, count):
        hat = np.maximum(1.0 - np.abs(place - knot) * (count - 1), 0.0)
        hats.append((float(knot), np.where(inside, hat, 0.0)))
    return hats
