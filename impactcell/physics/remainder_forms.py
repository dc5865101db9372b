"""Free forms of what a named law is held against, and that no law is made of.

Forces that go with speed or indentation, of which nobody says where they come from: along the table whatever
way the part goes, or in contact without vanishing where contact begins. As laws they would be strange; as
what a model of a real machine leaves they are common.
"""

from collections.abc import Mapping
from types import MappingProxyType

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.bspline import spline
from impactcell.physics.effect import Kind, LawKind
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

REMAINDER_FORMS: Mapping[str, FreeForm] = MappingProxyType(
    {**FREE_FORMS, **{form.effect.identifier: form for form in _DECLARED}}
)
"""Every place at which what is left may act, by the identifier of its effect."""
