"""Adhesion: a film between actuator and part pulls after separation, until it breaks."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def pull(gap: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """Return A (1 - gap/l)."""
    return p[0] * (1.0 - gap / p[1])


def reach(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """L, and none without a force."""
    return p[1] if p[0] != 0.0 else 0.0


EFFECT = Effect(
    identifier="adhesion",
    kind=Kind.CONTACT,
    equation="pull -A (1 - gap/l) after separation, gap < l",
    reference="Liquid bridge of constant volume, linearised: Israelachvili, Intermolecular and "
    "Surface Forces, 3rd ed. (2011), chapter 17",
    meaning="A film of oil or glue holds part and actuator together for a moment when they separate.",
    look_at="the faces that touch: oil, coolant, glue, a soft pad; clean them and repeat some taps",
    german=German(
        "Haften beim Trennen",
        "Ein Film aus Öl oder Kleber hält Teil und Stößel beim Trennen einen Moment zusammen.",
        (
            "die Flächen, die sich berühren: Öl, Kühlmittel, Kleber, weiche Auflage; reinigen, einige Stöße "
            "wiederholen"
        ),
    ),
    phases=(Phase.FREE_SLIDE,),
    parameters=(
        Parameter("force_n", "N", null=0.0, lower=0.0, upper=200.0, typical=10.0),
        Parameter("range_m", "m", null=math.nan, lower=1e-06, upper=0.01, typical=0.0003),
    ),
    laws={LawKind.PULL: pull, LawKind.REACH: reach},
)
"""Up to the weight of a part of 20 kg, over up to 10 mm; typical is a twentieth of it over 0.3 mm."""
