"""Where to look for an effect: a grid over the parameters that say nothing while its strength is zero.

A period, a range or a time constant has no derivative at zero strength, so that a score is taken at every
point of a grid; the best of them is also where the full fit starts. The grid follows from the parameter's
unit and from what the shots went through, so that a new effect needs no grid of its own.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.model import Coordinate, effect_coordinates
from impactcell.physics import ParameterKind
from impactcell.physics.effects import OF_PRODUCT
from impactcell.records import Samples

SMALL_STRENGTH = 2e-3
"""Strength, in units of an effect's typical one, at which its score is taken."""
DECADE_FACTORS = (0.1, 0.316, 1.0, 3.16, 10.0)
"""Two decades about the typical value of a shape that nothing else bounds."""
RECIPROCAL_POINTS = tuple(float(0.08 * 1.42**i) for i in range(16))
"""Of what vanishes at infinity, the typical value over these is tried."""
POSITIONS = 18
"""Positions over the range gone through, its ends left out."""
WIDTH_SHARES = np.array([0.025, 0.08])
"""Widths of a feature, over the span of positions gone through."""
LENGTH_SHARES = np.array([0.005, 0.015, 0.05, 0.15, 0.5])
"""Other lengths, over the same span."""
SPEED_SHARES = np.array([0.03, 0.08, 0.2, 0.4, 0.8])
"""Speeds, over the largest one."""
MAX_CYCLES = 40
"""Largest number of periods over the range gone through."""
CYCLE_STEP = 0.5
"""Half a period more at each point: the next one is out of phase by a quarter at either end."""


@dataclass(frozen=True, slots=True)
class VisitedRange:
    """What the shots went through.

    Attributes
    ----------
    low_m, high_m : float
        Positions on the table.
    speed_m_s : float
        Largest speed.
    """

    low_m: float
    high_m: float
    speed_m_s: float

    @property
    def span_m(self) -> float:
        """Width of the positions gone through."""
        return self.high_m - self.low_m


@dataclass(frozen=True, slots=True, eq=False)
class GridPoint:
    """One point of the grid.

    Attributes
    ----------
    theta : ndarray
        Coordinates of the effect.
    amplitude : int
        Which of them is the strength.
    sign : int
        +1 where only a positive strength makes sense, else 0.
    scaled : bool
        The strength is small here, so that a score tells how large it should be.
    """

    theta: Samples
    amplitude: int
    sign: int
    scaled: bool


def effect_grid(identifier: str, batches: int, visited: VisitedRange) -> tuple[GridPoint, ...]:
    """Grid of an effect; empty if it has no parameters here, as a batch shift with one batch."""
    coordinates = effect_coordinates(identifier, batches)
    strengths = [i for i, coordinate in enumerate(coordinates) if _is_strength(coordinate)]
    shapes = [i for i, coordinate in enumerate(coordinates) if not _is_strength(coordinate)]
    points: list[GridPoint] = []
    for strength in strengths:
        coordinate = coordinates[strength]
        if coordinate.form == "reciprocal":
            points += [
                GridPoint(np.array([value]), 0, 0, scaled=False)
                for value in RECIPROCAL_POINTS
                if coordinate.lower < value <= coordinate.upper
            ]
            continue
        turns = any(coordinates[i].form == "angle" for i in shapes)
        side = 1 if coordinate.lower >= coordinate.initial and not turns else 0
        for point in itertools.product(*(_grid(coordinates[i], visited) for i in shapes)):
            theta = np.array([c.initial for c in coordinates])
            theta[strength] = coordinate.initial + SMALL_STRENGTH
            for i, value in zip(shapes, point, strict=True):
                theta[i] = min(max(value, coordinates[i].lower), coordinates[i].upper)
            points.append(GridPoint(theta, strength, side, scaled=True))
    if shapes and strengths and identifier not in OF_PRODUCT:
        # Somebody knew this one: of a sum no term alone need be near, nor any point of a grid.
        points.append(GridPoint(_typical(coordinates), strengths[0], 1, scaled=False))
    return tuple(points)


def _typical(coordinates: Sequence[Coordinate]) -> Samples:
    """Coordinates of an effect as its file has it: a law that was found has there what was found."""
    given = [(one, one.definition.typical) for one in coordinates if one.definition is not None]
    return np.array([min(max(one.coordinate(value), one.lower), one.upper) for one, value in given])


def _is_strength(coordinate: Coordinate) -> bool:
    return coordinate.definition is not None and not math.isnan(coordinate.definition.null)


def _grid(coordinate: Coordinate, visited: VisitedRange) -> tuple[float, ...]:
    """Coordinates of a shape: by what it measures, else by its unit, else about its typical value."""
    parameter = coordinate.definition
    if parameter is None:
        raise AssertionError(coordinate)
    if parameter.kind is ParameterKind.PERIOD:
        # Even in frequency: a relative error of the period counts once a cycle.
        values = visited.span_m / np.arange(0.5, MAX_CYCLES, CYCLE_STEP)
    elif parameter.kind is ParameterKind.PHASE:
        # Sine and cosine; a negative amplitude is a phase turned by half.
        values = np.array([0.0, math.pi / 2])
    elif parameter.kind is ParameterKind.POSITION:
        values = np.linspace(visited.low_m, visited.high_m, POSITIONS + 2)[1:-1]
    elif parameter.kind is ParameterKind.WIDTH:
        values = visited.span_m * WIDTH_SHARES
    elif parameter.unit == "m":
        values = visited.span_m * LENGTH_SHARES
    elif parameter.unit == "m/s":
        values = visited.speed_m_s * SPEED_SHARES
    elif coordinate.form == "log":
        return tuple(coordinate.initial + math.log(factor) for factor in DECADE_FACTORS)
    else:
        return tuple(coordinate.initial * factor for factor in DECADE_FACTORS)
    return tuple(coordinate.coordinate(float(value)) for value in values)
