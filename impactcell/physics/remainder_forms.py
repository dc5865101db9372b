"""Free forms of what a named law is held against, and that no law is made of.

Forces that go with speed or indentation, of which nobody says where they come from: along the table whatever
way the part goes, or in contact without vanishing where contact begins. As laws they would be strange; as
what a model of a real machine leaves they are common. A filter of either channel is the free form of what
its amplifier and converter do; no spline is in it.
"""

from collections.abc import Mapping
from types import MappingProxyType

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.bspline import spline
from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, Phase
from impactcell.physics.effects import add_effect
from impactcell.physics.free_form import FreeForm
from impactcell.physics.free_forms import FREE_FORMS, SPANS, declare_form


def _force_over_speed(_x: float, v: float, _m: float, _g: float, p: FloatPointer) -> float:
    """s(|x'|) on a part that moves."""
    if v == 0.0:
        return 0.0
    return spline(abs(v), p, SPANS)


def _force_over_indentation(d: float, _rate: float, _k: float, _b: float, p: FloatPointer) -> float:
    """s(d) while in contact."""
    return spline(d, p, SPANS)


def _delay(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """Delay of the filter."""
    return p[0]


def _lag(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """Time constant of the filter."""
    return p[1]


_DECLARED = (
    declare_form(
        "free_force_over_speed",
        _force_over_speed,
        ("speed", "m/s", "abs(b)"),
        (LawKind.BODY, Kind.BODY, "s", "N", 3.0),
        "s(|x'|) on the part",
    ),
    declare_form(
        "free_force_over_indentation",
        _force_over_indentation,
        ("indentation", "m", "a"),
        (LawKind.CONTACT, Kind.CONTACT, "s", "N", 3.0),
        "s(d) in contact",
    ),
)
"""Places that no law is looked for in: forces in general. A force of 3 N shows clearly in a tap."""

REMAINDER_FORMS: Mapping[str, FreeForm] = MappingProxyType(
    {**FREE_FORMS, **{form.effect.identifier: form for form in _DECLARED}}
)
"""Every place at which what is left may act, by the identifier of its effect."""

FORCE_FILTER = Effect(
    identifier="free_filter_of_force",
    kind=Kind.SENSOR,
    equation="tau F_m' + F_m = F(t - delay)",
    reference="First-order lag with dead time: Astrom and Hagglund, Advanced PID Control (2006), chapter 2",
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING),
    parameters=(
        Parameter("delay_s", "s", null=0.0, lower=-0.01, upper=0.01, typical=3e-4),
        Parameter("time_constant_s", "s", null=0.0, lower=0.0, upper=0.02, typical=3e-4),
    ),
    laws={LawKind.DELAY: _delay, LawKind.LAG: _lag},
)
"""Filter of any delay and any lag: what a channel that comes late or rounded is held against. Ranges and
sizes are those of the named delay and lag."""
add_effect(FORCE_FILTER)

POSITION_FILTER = Effect(
    identifier="free_filter_of_position",
    kind=Kind.SENSOR,
    equation="tau x_m' + x_m = x(t + delay of the force)",
    reference=FORCE_FILTER.reference,
    phases=(Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE),
    parameters=FORCE_FILTER.parameters,
    laws={LawKind.DELAY: _delay, LawKind.POSITION_LAG: _lag},
)
"""The same of the position channel, whose delay is the force's early arrival."""
add_effect(POSITION_FILTER)

FILTERS: Mapping[str, Effect] = MappingProxyType(
    {one.identifier: one for one in (FORCE_FILTER, POSITION_FILTER)}
)
"""Filters by the identifiers of their effects."""
