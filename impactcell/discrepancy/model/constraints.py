"""What a fit is told beside its data: what is held, how rough a free-form term may be, where it acts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from impactcell.discrepancy.model.parameters import Coordinate, parameter_name
from impactcell.records import Samples


@dataclass(frozen=True, slots=True, eq=False)
class Roughness:
    """Quadratic penalty |D c|² on coordinates c of one effect, in squared standard deviations.

    Attributes
    ----------
    effect : str
    parameters : tuple of str
        Names of the coordinates it is about, in the order of the columns of D.
    rows : ndarray, shape (r, len(parameters))
        D, the square root of its weight in it.
    """

    effect: str
    parameters: tuple[str, ...]
    rows: Samples


@dataclass(frozen=True, slots=True, eq=False)
class Support:
    """Where on the table the coefficients of one effect act: elsewhere they change nothing.

    Attributes
    ----------
    effect : str
    parameters : tuple of str
    begin_m, end_m : ndarray, shape (len(parameters),)
        Positions between which each of them acts.
    """

    effect: str
    parameters: tuple[str, ...]
    begin_m: Samples
    end_m: Samples


@dataclass(frozen=True, slots=True, eq=False)
class Constraints:
    """Parameters that do not move, by name as the plant has them, penalties, and where coefficients act."""

    held: Mapping[str, float] = field(default_factory=dict)
    roughness: tuple[Roughness, ...] = ()
    supports: tuple[Support, ...] = ()

    def free(self, coordinates: tuple[Coordinate, ...]) -> tuple[Coordinate, ...]:
        """Coordinates that a fit may move."""
        return tuple(item for item in coordinates if parameter_name(item) not in self.held)

    def hold(self, names: tuple[str, ...], values: Samples) -> Samples:
        """Parameter vector of `names` with what is held at its value."""
        for place, name in enumerate(names):
            if name in self.held:
                values[place] = self.held[name]
        return values

    def penalty(self, coordinates: tuple[Coordinate, ...]) -> Samples:
        """Matrix P, shape (p, p), of the penalty theta' P theta."""
        matrix = np.zeros((len(coordinates), len(coordinates)))
        places = {(item.effect, item.parameter): place for place, item in enumerate(coordinates)}
        for term in self.roughness:
            if all((term.effect, name) in places for name in term.parameters):
                columns = [places[term.effect, name] for name in term.parameters]
                matrix[np.ix_(columns, columns)] += term.rows.T @ term.rows
        return matrix

    def acts_between(self, coordinates: tuple[Coordinate, ...]) -> tuple[Samples, Samples]:
        """Positions on the table between which each coordinate acts [m], shape (p,) each; else infinite."""
        ends = {
            (support.effect, name): pair
            for support in self.supports
            for name, *pair in zip(support.parameters, support.begin_m, support.end_m, strict=True)
        }
        everywhere = [-math.inf, math.inf]
        pairs = [ends.get((item.effect, item.parameter), everywhere) for item in coordinates]
        begin, end = np.array(pairs, dtype=np.float64).reshape(-1, 2).T
        return begin, end


UNCONSTRAINED = Constraints()
"""Nothing is held, nothing penalised."""
