"""Which parameters a fit is free in, and the scale on which it moves each of them.

A fit moves coordinates, not the parameters themselves: logarithms of what is positive, mu_s / mu_k instead of
mu_s, reciprocals of what vanishes at infinity. On these scales the residuals are closer to linear.
"""

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from impactcell.physics import Effect, Parameter, ParameterKind
from impactcell.physics.effects import find_effect
from impactcell.records import Samples

MIN_RATIO, MAX_RATIO = 1.0, 5.0
"""Range of mu_s / mu_k: stiction is never below kinetic friction, and five times it is unheard of."""
DAMPING_SCALE = 100.0
"""Unit [N s/m] in which a fit moves the damping, about a fifth of the source paper's."""
MIN_TIME_CONSTANT_SHARE = 0.02
"""Time constants shorter than this share of the typical one act at once and only make the plant stiff."""
MIN_RECIPROCAL_SHARE = 1e-3
"""What vanishes at infinity is never looked for below this share of its typical value."""
SMALLEST_SCALE = 1e-9
"""A typical value below this share of its range is no scale: a place on the table may well be its middle."""
MAX_ANGLE = 1e3
"""Range of an angle's coordinate: none, as a fit may go round."""


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One free number of a fit.

    Attributes
    ----------
    effect : str
        Empty for the nominal plant.
    parameter : str
        Name as `result.json` has it.
    batch : int
        0, or the batch whose parameter it is.
    form : str
        `log`, `linear` (value over scale), `angle` (the same, modulo a turn) or `reciprocal` (scale over
        value).
    lower, upper : float
        Range of the coordinate itself.
    initial : float
        Value of the coordinate where nothing better is known.
    definition : Parameter or None
        As the effect declares it; None for the nominal plant.
    """

    effect: str
    parameter: str
    batch: int
    form: str
    scale: float
    lower: float
    upper: float
    initial: float
    definition: Parameter | None = field(default=None, compare=False)

    def value(self, coordinate: float) -> float:
        """Parameter at a coordinate."""
        if self.form == "log":
            return self.scale * math.exp(coordinate)
        if self.form == "reciprocal":
            return self.scale / coordinate if coordinate > 0.0 else math.inf
        if self.form == "angle":
            return math.remainder(self.scale * coordinate, 2.0 * math.pi)
        return self.scale * coordinate

    def coordinate(self, value: float) -> float:
        """Coordinate of a parameter."""
        if self.form == "log":
            return math.log(value / self.scale)
        if self.form == "reciprocal":
            return self.scale / value
        return value / self.scale


NOMINAL_COORDINATES = (
    Coordinate("", "stiffness_n_per_m", 0, "log", 1.0, math.log(1e2), math.log(1e11), math.log(6e5)),
    Coordinate("", "damping_n_s_per_m", 0, "linear", DAMPING_SCALE, 0.0, 1e6, 4.0),
    Coordinate("", "mu_k", 0, "log", 1.0, math.log(1e-3), math.log(3.0), math.log(0.15)),
    Coordinate("", "ratio", 0, "log", 1.0, math.log(MIN_RATIO), math.log(MAX_RATIO), 0.25),
)
"""Free numbers of the nominal plant: far wider than any material, so that no bound decides."""
PLANT_PARAMETERS = tuple(coordinate.parameter for coordinate in NOMINAL_COORDINATES)
"""Their names; `ratio` is mu_s / mu_k."""


def nominal_coordinates(free: tuple[str, ...]) -> tuple[Coordinate, ...]:
    """Free numbers of the nominal plant: those of its parameters that are named."""
    return tuple(coordinate for coordinate in NOMINAL_COORDINATES if coordinate.parameter in free)


def effect_coordinates(identifier: str, batches: int) -> tuple[Coordinate, ...]:
    """Free numbers of an effect."""
    return _coordinates(find_effect(identifier), batches)


@lru_cache(maxsize=256)
def _coordinates(effect: Effect, batches: int) -> tuple[Coordinate, ...]:
    coordinates: list[Coordinate] = []
    for parameter in effect.parameters:
        numbers = range(1, batches) if parameter.per_batch else (0,)
        coordinates += [_coordinate(effect.identifier, parameter, batch) for batch in numbers]
    return tuple(coordinates)


def _coordinate(identifier: str, parameter: Parameter, batch: int) -> Coordinate:
    form, scale, lower, upper, initial = _scaled(parameter)
    return Coordinate(identifier, parameter.name, batch, form, scale, lower, upper, initial, parameter)


def _scaled(parameter: Parameter) -> tuple[str, float, float, float, float]:
    """Form, scale, range and first value of a parameter's coordinate."""
    typical = parameter.typical
    if math.isinf(parameter.null):
        smallest = max(parameter.lower, MIN_RECIPROCAL_SHARE * typical)
        return "reciprocal", typical, typical / parameter.upper, typical / smallest, 1.0
    if math.isnan(parameter.null) and parameter.lower > 0.0:
        is_time = parameter.unit == "s"
        smallest = max(parameter.lower, MIN_TIME_CONSTANT_SHARE * typical) if is_time else parameter.lower
        return "log", 1.0, math.log(smallest), math.log(parameter.upper), math.log(typical)
    start = typical if math.isnan(parameter.null) else parameter.null
    if parameter.kind is ParameterKind.PHASE:
        # An angle has no ends; a fit may go round.
        return "angle", typical, -MAX_ANGLE, MAX_ANGLE, start / typical
    scale = _linear_scale(parameter)
    return "linear", scale, parameter.lower / scale, parameter.upper / scale, start / scale


def _linear_scale(parameter: Parameter) -> float:
    """Typical value of a parameter, or the largest of its range where that is 0 but for rounding."""
    ends = [abs(end) for end in (parameter.lower, parameter.upper) if math.isfinite(end)]
    largest = max(ends, default=0.0)
    if abs(parameter.typical) > SMALLEST_SCALE * largest:
        return abs(parameter.typical)
    return largest or 1.0


def parameter_columns(coordinates: tuple[Coordinate, ...], names: tuple[str, ...]) -> tuple[int, ...]:
    """Place of each coordinate's parameter among the plant's `names`; -1 for mu_s/mu_k, which is none."""
    return tuple(
        -1 if is_friction_ratio(coordinate) else names.index(parameter_name(coordinate))
        for coordinate in coordinates
    )


def is_friction_ratio(coordinate: Coordinate) -> bool:
    """Whether a coordinate is mu_s/mu_k of the plant."""
    return coordinate.parameter == "ratio" and not coordinate.effect


def plant_parameters(
    coordinates: tuple[Coordinate, ...], theta: Samples, columns: tuple[int, ...], typical: Samples
) -> Samples:
    """Parameter vector of the plant from coordinates.

    `columns` are those of `parameter_columns`; `typical` holds what is taken for what is not free.
    """
    parameters = typical.copy()
    ratio = math.nan
    for coordinate, theta_value, column in zip(coordinates, theta.tolist(), columns, strict=True):
        value = coordinate.value(theta_value)
        if column < 0:
            ratio = value
            continue
        parameters[column] = value
    if not math.isnan(ratio):
        parameters[2] = ratio * parameters[3]
    else:
        parameters[2] = max(parameters[2], parameters[3])
    return parameters


def parameter_name(coordinate: Coordinate) -> str:
    """Name of a coordinate's parameter among those of `physics`."""
    if not coordinate.effect:
        return coordinate.parameter
    name = f"{coordinate.effect}.{coordinate.parameter}"
    return f"{name}[{coordinate.batch}]" if coordinate.batch else name


def default_parameters(names: tuple[str, ...]) -> Samples:
    """Parameter vector for whatever is not free: a stiff contact, friction in the middle of its range."""
    return np.array([6e5, 0.0, 0.2, 0.15, *([0.0] * (len(names) - 4))])
