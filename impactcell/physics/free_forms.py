"""Free-form terms: a smooth function of one covariate wherever a law may act in the equations of motion.

Each is an effect like any other, with the coefficients of a cubic B-spline on uniform knots as its parameters
(de Boor, A Practical Guide to Splines, 1978): `lower` and `upper` say where the knots lie and are held in a
fit, `c0`, `c1`, ... are fitted. Beyond the knots the spline goes on along its tangent. What physics asks is
built into the place: no force without indentation, no drag without speed, no pull beyond its reach.
They are no named effects: nobody accepts one, and no YAML offers them.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType

from impactcell.numerics.jit import FloatPointer, Law
from impactcell.physics.bspline import spline
from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, Phase
from impactcell.physics.effects import add_effect
from impactcell.physics.free_form import FINE, FreeForm

SPANS = 7
"""Polynomial pieces of a spline: an S with a fold is followed, a single sample is not. Own choice."""
SPANS_OF_TABLE = 24
"""The same over the position on the table, where a surface may have waves and spots: a wave takes three."""
FINE_SPANS = 72
"""The same where those leave something: two dozen waves."""
LOWER, UPPER = "lower", "upper"
"""Names of the parameters that say where the knots lie."""


def _friction_over_speed(speed: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """s(|x'|), added to mu_k."""
    return spline(speed, p, SPANS)


def _friction_over_position(x: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """1 + s(x), factor of mu_s and mu_k."""
    return 1.0 + spline(x, p, SPANS_OF_TABLE)


def _force_over_position(x: float, _v: float, _m: float, _g: float, p: FloatPointer) -> float:
    """s(x) on the part."""
    return spline(x, p, SPANS_OF_TABLE)


def _friction_over_position_fine(x: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """1 + s(x), factor of mu_s and mu_k."""
    return 1.0 + spline(x, p, FINE_SPANS)


def _force_over_position_fine(x: float, _v: float, _m: float, _g: float, p: FloatPointer) -> float:
    """s(x) on the part."""
    return spline(x, p, FINE_SPANS)


def _drag_over_speed(_x: float, v: float, _m: float, _g: float, p: FloatPointer) -> float:
    """-x' s(|x'|) on the part: odd, and nothing at rest."""
    return -v * spline(abs(v), p, SPANS)


def _stiffness_over_indentation(d: float, _rate: float, _k: float, _b: float, p: FloatPointer) -> float:
    """D s(d): nothing where contact is lost."""
    return d * spline(d, p, SPANS)


def _damping_over_indentation(d: float, rate: float, _k: float, _b: float, p: FloatPointer) -> float:
    """D' s(d)."""
    return rate * spline(d, p, SPANS)


def _damping_over_rate(_d: float, rate: float, _k: float, _b: float, p: FloatPointer) -> float:
    """D' s(d')."""
    return rate * spline(rate, p, SPANS)


def _pull_over_gap(gap: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """S(gap) while the gap is below `upper`."""
    return spline(gap, p, SPANS)


def _reach(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """Gap at which the pull ends."""
    return p[1]


def _speed_over_time(t: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """1 + s(t), factor of the actuator's speed."""
    return 1.0 + spline(t, p, SPANS)


def _reading_over_force(force: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """F (1 + s(F)) is shown."""
    return force * (1.0 + spline(force, p, SPANS))


_CONTACT = (Phase.LOADING, Phase.UNLOADING)
_SLIP = (Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.DRIVEN)


def declare_form(
    identifier: str,
    law: Law,
    covariate: tuple[str, str, str],
    function: tuple[LawKind, Kind, str, str, float],
    equation: str,
    *,
    extra: Mapping[LawKind, Law] = MappingProxyType({}),
    constant_is: str = "",
    dissipates: str = "",
    spans: int = SPANS,
) -> FreeForm:
    """Declare a place: its covariate (name, unit, argument), and how its function enters.

    `function` holds the kind of law, what it acts on, how s enters, its unit, and a size that shows clearly.
    """
    name, covariate_unit, argument = covariate
    law_kind, kind, around, unit, typical = function
    knots = tuple(
        Parameter(end, covariate_unit, null=math.nan, lower=-math.inf, upper=math.inf, typical=1.0)
        for end in (LOWER, UPPER)
    )
    coefficients = tuple(
        Parameter(f"c{i}", unit, null=0.0, lower=-1e3 * typical, upper=1e3 * typical, typical=typical)
        for i in range(spans + 3)
    )
    effect = Effect(
        identifier=identifier,
        kind=kind,
        equation=equation,
        reference="Free-form term: cubic B-spline, de Boor (1978)",
        phases=_CONTACT if law_kind in {LawKind.CONTACT, LawKind.READING, LawKind.SPEED} else _SLIP,
        parameters=(*knots, *coefficients),
        laws={law_kind: law, **extra},
    )
    add_effect(effect)
    return FreeForm(effect, name, covariate_unit, law_kind, around, argument, constant_is, dissipates)


_DECLARED = (
    declare_form(
        "free_friction_over_speed",
        _friction_over_speed,
        ("speed", "m/s", "a"),
        (LawKind.KINETIC, Kind.FRICTION, "s", "1", 0.03),
        "mu_k + s(|x'|)",
        constant_is="mu_k",
        dissipates="mu_k",
    ),
    *(
        declare_form(
            f"free_friction_over_position{end}",
            law,
            ("position", "m", "a"),
            (LawKind.SCALE, Kind.FRICTION, "1.0 + s", "1", 0.1),
            "mu (1 + s(x))",
            constant_is="mu_k",
            spans=spans,
        )
        for end, law, spans in (
            ("", _friction_over_position, SPANS_OF_TABLE),
            (FINE, _friction_over_position_fine, FINE_SPANS),
        )
    ),
    *(
        declare_form(
            f"free_force_over_position{end}",
            law,
            ("position", "m", "a"),
            (LawKind.BODY, Kind.BODY, "s", "N", 3.0),
            "s(x) on the part",
            spans=spans,
        )
        for end, law, spans in (
            ("", _force_over_position, SPANS_OF_TABLE),
            (FINE, _force_over_position_fine, FINE_SPANS),
        )
    ),
    declare_form(
        "free_drag_over_speed",
        _drag_over_speed,
        ("speed", "m/s", "abs(b)"),
        (LawKind.BODY, Kind.BODY, "-b * s", "N s/m", 50.0),
        "-x' s(|x'|)",
        dissipates="0",
    ),
    declare_form(
        "free_stiffness_over_indentation",
        _stiffness_over_indentation,
        ("indentation", "m", "a"),
        (LawKind.CONTACT, Kind.CONTACT, "a * s", "N/m", 1e5),
        "d s(d)",
        constant_is="stiffness_n_per_m",
    ),
    declare_form(
        "free_damping_over_indentation",
        _damping_over_indentation,
        ("indentation", "m", "a"),
        (LawKind.CONTACT, Kind.CONTACT, "b * s", "N s/m", 100.0),
        "d' s(d)",
        constant_is="damping_n_s_per_m",
        dissipates="damping_n_s_per_m",
    ),
    declare_form(
        "free_damping_over_rate",
        _damping_over_rate,
        ("indentation_rate", "m/s", "b"),
        (LawKind.CONTACT, Kind.CONTACT, "b * s", "N s/m", 100.0),
        "d' s(d')",
        constant_is="damping_n_s_per_m",
        dissipates="damping_n_s_per_m",
    ),
    declare_form(
        "free_pull_over_gap",
        _pull_over_gap,
        ("gap", "m", "a"),
        (LawKind.PULL, Kind.CONTACT, "s", "N", 3.0),
        "pull s(gap), gap < l",
        extra={LawKind.REACH: _reach},
    ),
    declare_form(
        "free_speed_over_time",
        _speed_over_time,
        ("time", "s", "a"),
        (LawKind.SPEED, Kind.ACTUATOR, "1.0 + s", "1", 0.05),
        "y' = v (1 + s(t))",
    ),
    declare_form(
        "free_reading_over_force",
        _reading_over_force,
        ("force", "N", "a"),
        (LawKind.READING, Kind.SENSOR, "a * (1.0 + s)", "1", 0.03),
        "F (1 + s(F)) is shown",
    ),
)
"""Friction, forces on the part, contact, actuator and sensor: wherever a law of one covariate may act."""

_BY_NAME = {form.effect.identifier: form for form in _DECLARED}
FREE_FORMS: Mapping[str, FreeForm] = MappingProxyType(
    {name: form for name, form in _BY_NAME.items() if not name.endswith(FINE)}
)
"""Every place by the identifier of its effect."""
FINER: Mapping[str, FreeForm] = MappingProxyType(
    {name: _BY_NAME[name + FINE] for name in FREE_FORMS if name + FINE in _BY_NAME}
)
"""Terms with more pieces at the same places, where there are any."""
