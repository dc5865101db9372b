"""Where to look for an effect: a grid over the parameters that say nothing while its strength is zero.

A period, a range or a time constant has no derivative at zero strength, so that a score is taken at every
point of a grid; the best of them is also where the full fit starts. The grid follows from the parameter's
unit and from what the shots went through, so that a new effect needs no grid of its own.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.model.parameters import Coordinate, of_effect
from impactcell.records import Samples

SMALL = 2e-3
DECADE = (0.1, 0.316, 1.0, 3.16, 10.0)
RECIPROCALS = tuple(float(0.08 * 1.42**i) for i in range(16))
CYCLES = 40
CYCLE_STEP = 0.5


@dataclass(frozen=True, slots=True)
class Range:
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
class Probe:
    """One point of the grid.

    Attributes
    ----------
    at : ndarray
        Coordinates of the effect.
    amplitude : int
        Which of them is the strength.
    side : int
        +1 where only a positive strength makes sense, else 0.
    scaled : bool
        The strength is small here, so that a score tells how large it should be.
    """

    at: Samples
    amplitude: int
    side: int
    scaled: bool


def probes(identifier: str, batches: int, gone: Range) -> tuple[Probe, ...]:
    """Grid of an effect; empty if it has no parameters here, as a batch shift with one batch."""
    coordinates = of_effect(identifier, batches)
    strengths = [i for i, one in enumerate(coordinates) if _is_strength(one)]
    shapes = [i for i, one in enumerate(coordinates) if not _is_strength(one)]
    made: list[Probe] = []
    for strength in strengths:
        one = coordinates[strength]
        if one.form == "reciprocal":
            made += [
                Probe(np.array([value]), 0, 0, scaled=False)
                for value in RECIPROCALS
                if one.lower < value <= one.upper
            ]
            continue
        turns = any(coordinates[i].parameter.endswith("phase_rad") for i in shapes)
        side = 1 if one.lower >= one.start and not turns else 0
        for point in itertools.product(*(_grid(coordinates[i], gone) for i in shapes)):
            at = np.array([c.start for c in coordinates])
            at[strength] = one.start + SMALL
            for i, value in zip(shapes, point, strict=True):
                at[i] = min(max(value, coordinates[i].lower), coordinates[i].upper)
            made.append(Probe(at, strength, side, scaled=True))
    return tuple(made)


def _is_strength(one: Coordinate) -> bool:
    from impactcell.physics.effects import LIBRARY

    for parameter in LIBRARY[one.effect].parameters:
        if parameter.name == one.parameter:
            return not math.isnan(parameter.null)
    return False


def _grid(one: Coordinate, gone: Range) -> tuple[float, ...]:
    if one.parameter.startswith("period"):
        # Even in frequency: a relative error of the period counts once a cycle.
        count = np.arange(0.5, CYCLES, CYCLE_STEP)
        return tuple(one.coordinate(gone.span_m / value) for value in count)
    if one.parameter.endswith("_rad"):
        # Sine and cosine; a negative amplitude is a phase turned by half.
        return (one.coordinate(0.0), one.coordinate(math.pi / 2))
    if one.form == "linear" and one.parameter.endswith("_m"):
        inside = np.linspace(gone.low_m, gone.high_m, 20)[1:-1]
        return tuple(one.coordinate(float(value)) for value in inside)
    if one.parameter.startswith("width"):
        return tuple(one.coordinate(gone.span_m * share) for share in (0.025, 0.08))
    if one.parameter.endswith("_m"):
        return tuple(one.coordinate(gone.span_m * share) for share in (0.005, 0.015, 0.05, 0.15, 0.5))
    if one.parameter.endswith("_m_s"):
        return tuple(one.coordinate(gone.speed_m_s * share) for share in (0.03, 0.08, 0.2, 0.4, 0.8))
    if one.form == "log":
        return tuple(one.start + math.log(factor) for factor in DECADE)
    return tuple(one.start * factor for factor in DECADE)
