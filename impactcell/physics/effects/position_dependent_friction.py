"""Friction that changes along the table, in proportion to the position."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def factor(x: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """1 + a x."""
    return 1.0 + p[0] * x


EFFECT = Effect(
    identifier="position_dependent_friction",
    kind=Kind.FRICTION,
    equation="mu (1 + a x)",
    reference="First order of any slow variation of the surface",
    meaning="Friction grows steadily from one end of the table to the other.",
    look_at="wear, dirt or oil spread unevenly along the table, and whether the part is "
    "guided more tightly at one end",
    german=German(
        "Ortsabhängige Reibung",
        "Die Reibung wächst stetig von einem Ende des Tisches zum anderen.",
        (
            "ungleichen Verschleiß, Schmutz oder Öl entlang des Tisches, und ob das Teil an einem Ende enger "
            "geführt ist"
        ),
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.DRIVEN),
    parameters=(Parameter("gradient_per_m", "1/m", null=0.0, lower=-50.0, upper=50.0, typical=10.0),),
    laws={LawKind.SCALE: factor},
)
"""Up to twice the friction within 20 mm; typical is 1 % a millimetre."""
