"""Friction patch: one place on the table is rougher or smoother."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, ParameterKind, Phase


def factor(x: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """1 + a exp(-(x - x_0)²/2w²)."""
    return 1.0 + p[0] * math.exp(-0.5 * ((x - p[1]) / p[2]) ** 2)


EFFECT = Effect(
    identifier="friction_patch",
    kind=Kind.FRICTION,
    equation="mu (1 + a exp(-(x - x_0)²/2w²))",
    reference="A local wear scar or contamination, as a Gaussian",
    meaning="At one place on the table the surface is rougher or smoother than elsewhere.",
    look_at="the table at the position named: a scratch, a worn or soiled spot, a joint between two plates",
    german=German(
        "Stelle anderer Reibung",
        "An einer Stelle des Tisches ist die Oberfläche rauer oder glatter als sonst.",
        "den Tisch an der genannten Stelle: Kratzer, verschlissener oder schmutziger Fleck, Plattenstoß",
    ),
    phases=(Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.DRIVEN),
    parameters=(
        Parameter("amplitude", "1", null=0.0, lower=-0.9, upper=3.0, typical=0.3),
        Parameter(
            "position_m",
            "m",
            null=math.nan,
            lower=-0.1,
            upper=0.1,
            typical=0.003,
            kind=ParameterKind.POSITION,
        ),
        Parameter(
            "width_m", "m", null=math.nan, lower=5e-05, upper=0.05, typical=0.0005, kind=ParameterKind.WIDTH
        ),
    ),
    laws={LawKind.SCALE: factor},
)
"""A tenth to four times the friction, 0.05 to 50 mm wide; typical is 30 % over half a millimetre."""
