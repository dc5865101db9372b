"""A force that is felt around one place of the table: a magnet, a cable that tightens, a jet of air."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, ParameterKind, Phase


def bump(x: float, _v: float, _m: float, _g: float, p: FloatPointer) -> float:
    """P exp(-(x - x_0)²/2w²)."""
    return p[0] * math.exp(-0.5 * ((x - p[1]) / p[2]) ** 2)


EFFECT = Effect(
    identifier="position_force",
    kind=Kind.BODY,
    equation="P exp(-(x - x_0)²/2w²) along +1",
    reference="First term of any force that is bound to a place; cogging of linear drives is a row of them",
    phases=(Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.DRIVEN),
    parameters=(
        Parameter("force_n", "N", null=0.0, lower=-100.0, upper=100.0, typical=5.0),
        Parameter(
            "position_m",
            "m",
            null=math.nan,
            lower=-0.2,
            upper=0.2,
            typical=0.003,
            kind=ParameterKind.POSITION,
        ),
        Parameter(
            "width_m", "m", null=math.nan, lower=1e-4, upper=0.1, typical=0.002, kind=ParameterKind.WIDTH
        ),
    ),
    laws={LawKind.BODY: bump},
)
"""Up to half the weight of 20 kg, over 0.1 to 100 mm; typical is 5 N about 3 mm from the start."""
