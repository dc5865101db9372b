"""Periodic friction: the surface has a lay, as from milling or grinding."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, ParameterKind, Phase


def factor(x: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """1 + a sin(2 pi x/p + phase)."""
    return 1.0 + p[0] * math.sin(2.0 * math.pi * x / p[1] + p[2])


EFFECT = Effect(
    identifier="periodic_friction",
    kind=Kind.FRICTION,
    equation="mu (1 + a sin(2 pi x/p + phase))",
    reference="First harmonic of a surface texture: ISO 21920-2 (2021)",
    meaning="Friction rises and falls again and again along the table.",
    look_at="the table's surface: tracks of milling or grinding with the period named, "
    "grooves, a row of bores",
    german=German(
        "Periodische Reibung",
        "Die Reibung steigt und fällt entlang des Tisches immer wieder.",
        "die Oberfläche des Tisches: Fräs- oder Schleifspuren der genannten Periode, Nuten, Bohrungsreihen",
    ),
    phases=(Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.DRIVEN),
    parameters=(
        Parameter("amplitude", "1", null=0.0, lower=0.0, upper=0.9, typical=0.1),
        Parameter(
            "period_m", "m", null=math.nan, lower=0.0001, upper=0.1, typical=0.002, kind=ParameterKind.PERIOD
        ),
        Parameter(
            "phase_rad",
            "rad",
            null=math.nan,
            lower=-math.pi,
            upper=math.pi,
            typical=1.0,
            kind=ParameterKind.PHASE,
        ),
    ),
    laws={LawKind.SCALE: factor},
)
"""Friction stays above zero, in periods of 0.1 to 100 mm; typical is 10 % every 2 mm."""
