"""Viscous friction that differs by direction: a lip seal or a wiper drags more one way than the other."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, Phase

SMOOTHING_M_S = 1e-4
"""Speed below which |x'| is rounded, so that the law is smooth at a reversal: far below that of a slide."""


def asymmetry(_x: float, v: float, _m: float, _g: float, p: FloatPointer) -> float:
    """Give -a |x'|, rounded below SMOOTHING_M_S."""
    return -p[0] * v * v / math.sqrt(v * v + SMOOTHING_M_S * SMOOTHING_M_S)


EFFECT = Effect(
    identifier="directional_viscous_friction",
    kind=Kind.FRICTION,
    equation="-a abs(x'): beside k_v x' the coefficient is k_v + a along +1 and k_v - a along -1",
    reference="Armstrong-Helouvry, Dupont and Canudas de Wit, A survey of models, analysis tools and "
    "compensation methods for the control of machines with friction, Automatica 30 (1994)",
    phases=(Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.DRIVEN),
    parameters=(
        Parameter("asymmetry_n_s_per_m", "N s/m", null=0.0, lower=-500.0, upper=500.0, typical=30.0),
    ),
    laws={LawKind.BODY: asymmetry},
)
"""At 0.1 m/s the ends differ by 50 N from the mean of both directions; typical by 3 N."""
