"""Free-form terms of two covariates: a smooth function of both wherever such a law may act.

As those of `impactcell.physics.free_forms`, with the coefficients of a tensor product of B-splines as their
parameters: seven pieces along the first covariate, one cubic along the second. The second is another number
of the motion, or a further column of `shots.csv`, such as a temperature, whose value a law finds behind its
parameters.
"""

import hashlib
import math
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from impactcell.numerics.jit import FloatPointer, Law
from impactcell.physics.bspline import tensor_spline
from impactcell.physics.effect import Effect, Parameter
from impactcell.physics.effects import add_effect
from impactcell.physics.free_column_forms import column_letters, printed
from impactcell.physics.free_form import ACROSS, FreeForm
from impactcell.physics.free_forms import FREE_FORMS, LOWER, SPANS, UPPER

SECOND_LOWER, SECOND_UPPER = "second_lower", "second_upper"
"""Names of the parameters that say where the knots of the second covariate lie."""
NUMBERS = 4 + ACROSS * (SPANS + 3)
"""Parameters of a term: four ends of knots, and the coefficients. Behind them stands the shot's column."""


def _friction_over_speed_and_position(speed: float, x: float, _c: float, _d: float, p: FloatPointer) -> float:
    """s(|x'|, x), added to mu_k."""
    return tensor_spline(speed, x, p, SPANS)


def _drag_over_speed_and_position(x: float, v: float, _m: float, _g: float, p: FloatPointer) -> float:
    """-x' s(|x'|, x) on the part."""
    return -v * tensor_spline(abs(v), x, p, SPANS)


def _damping_over_indentation_and_rate(d: float, rate: float, _k: float, _b: float, p: FloatPointer) -> float:
    """D' s(d, d')."""
    return rate * tensor_spline(d, rate, p, SPANS)


def _friction_over_speed(speed: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """s(|x'|, w), added to mu_k."""
    return tensor_spline(speed, p[NUMBERS], p, SPANS)


def _friction_over_position(x: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """1 + s(x, w), factor of mu_s and mu_k."""
    return 1.0 + tensor_spline(x, p[NUMBERS], p, SPANS)


def _force_over_position(x: float, _v: float, _m: float, _g: float, p: FloatPointer) -> float:
    """s(x, w) on the part."""
    return tensor_spline(x, p[NUMBERS], p, SPANS)


def _drag_over_speed(_x: float, v: float, _m: float, _g: float, p: FloatPointer) -> float:
    """-x' s(|x'|, w) on the part."""
    return -v * tensor_spline(abs(v), p[NUMBERS], p, SPANS)


def _stiffness_over_indentation(d: float, _rate: float, _k: float, _b: float, p: FloatPointer) -> float:
    """D s(d, w): nothing where contact is lost."""
    return d * tensor_spline(d, p[NUMBERS], p, SPANS)


def _damping_over_indentation(d: float, rate: float, _k: float, _b: float, p: FloatPointer) -> float:
    """D' s(d, w)."""
    return rate * tensor_spline(d, p[NUMBERS], p, SPANS)


def _reading_over_force(force: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """F (1 + s(F, w)) is shown."""
    return force * (1.0 + tensor_spline(force, p[NUMBERS], p, SPANS))


def _declared(
    single: FreeForm, law: Law, second: tuple[str, str, str], equation: str, *, column: str = ""
) -> FreeForm:
    """Declare a place as one of a single covariate is, with a second one (name, unit, argument) beside it."""
    name, unit, argument = second
    ends = tuple(
        Parameter(end, end_unit, null=math.nan, lower=-math.inf, upper=math.inf, typical=1.0)
        for end, end_unit in (
            (LOWER, single.covariate_unit), (UPPER, single.covariate_unit), (SECOND_LOWER, unit),
            (SECOND_UPPER, unit),
        )
    )  # fmt: skip
    of_single = single.effect.parameters[2]
    coefficients = tuple(
        Parameter(
            f"c{i}", of_single.unit, null=0.0, lower=of_single.lower, upper=of_single.upper,
            typical=of_single.typical,
        )
        for i in range(ACROSS * (SPANS + 3))
    )  # fmt: skip
    check = f"_{column_letters(column)}_{hashlib.sha256(column.encode()).hexdigest()[:6]}" if column else ""
    if single.law_kind is None:
        raise AssertionError(single.effect.identifier)
    effect = Effect(
        identifier=f"{single.effect.identifier}_and_{'column' if column else name}{check}",
        kind=single.effect.kind,
        equation=equation,
        reference="Free-form term: tensor product of cubic B-splines, de Boor (1978)",
        phases=single.effect.phases,
        parameters=(*ends, *coefficients),
        laws={single.law_kind: law},
        columns={column: (-math.inf, math.inf)} if column else {},
    )
    add_effect(effect)
    return FreeForm(
        effect, single.covariate, single.covariate_unit, single.law_kind, single.around, single.argument,
        single.constant_is, single.dissipates, name, unit, argument,
    )  # fmt: skip


_OF_MOTION = (
    _declared(
        FREE_FORMS["free_friction_over_speed"],
        _friction_over_speed_and_position,
        ("position", "m", "b"),
        "mu_k + s(|x'|, x)",
    ),
    _declared(
        FREE_FORMS["free_drag_over_speed"],
        _drag_over_speed_and_position,
        ("position", "m", "a"),
        "-x' s(|x'|, x)",
    ),
    _declared(
        FREE_FORMS["free_damping_over_indentation"],
        _damping_over_indentation_and_rate,
        ("indentation_rate", "m/s", "b"),
        "d' s(d, d')",
    ),
)
FREE_PAIR_FORMS: Mapping[str, FreeForm] = MappingProxyType(
    {form.effect.identifier: form for form in _OF_MOTION}
)
"""Places of two numbers of the motion, by the identifier of their effect."""

_OVER_COLUMN: Mapping[str, tuple[Law, str]] = MappingProxyType(
    {
        "free_friction_over_speed": (_friction_over_speed, "mu_k + s(|x'|, {0})"),
        "free_friction_over_position": (_friction_over_position, "mu (1 + s(x, {0}))"),
        "free_force_over_position": (_force_over_position, "s(x, {0}) on the part"),
        "free_drag_over_speed": (_drag_over_speed, "-x' s(|x'|, {0})"),
        "free_stiffness_over_indentation": (_stiffness_over_indentation, "d s(d, {0})"),
        "free_damping_over_indentation": (_damping_over_indentation, "d' s(d, {0})"),
        "free_reading_over_force": (_reading_over_force, "F (1 + s(F, {0})) is shown"),
    }
)
"""Laws of a number of the motion and a column, and how they are printed, by the place of the first alone."""


@cache
def column_pair_forms(column: str) -> tuple[FreeForm, ...]:
    """Places of a number of the motion and a column of `shots.csv`; the same ones whenever asked for."""
    return tuple(
        _declared(
            FREE_FORMS[single],
            law,
            (column, "1", f"p[{NUMBERS}]"),
            equation.format(printed(column)),
            column=column,
        )
        for single, (law, equation) in _OVER_COLUMN.items()
    )
