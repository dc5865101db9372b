"""Stribeck friction: kinetic friction is larger in slow slip, where the film is not yet carried."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def excess(speed: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """Dmu exp(-(x'/v_s)²)."""
    return p[0] * math.exp(-((speed / p[1]) ** 2))


EFFECT = Effect(
    identifier="stribeck_friction",
    kind=Kind.FRICTION,
    equation="mu_k + dmu exp(-(x'/v_s)²)",
    reference="Bo and Pavelescu, The friction-speed relation, Wear 82 (1982)",
    meaning="Friction is higher while the part slides slowly; at speed a film carries it.",
    look_at="lubrication: kind and amount of oil, and whether the slide is long enough at low "
    "speed for it to matter",
    german=German(
        "Stribeck-Reibung",
        "Die Reibung ist höher, solange das Teil langsam gleitet; bei Geschwindigkeit trägt ein Film.",
        "die Schmierung: Art und Menge des Öls, und ob das Teil lange genug langsam gleitet, dass es zählt",
    ),
    phases=(Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.DRIVEN),
    parameters=(
        Parameter("friction_increase", "1", null=0.0, lower=0.0, upper=0.5, typical=0.03),
        Parameter("stribeck_velocity_m_s", "m/s", null=math.nan, lower=0.0001, upper=1.0, typical=0.02),
    ),
    laws={LawKind.KINETIC: excess},
    dissipates=True,
)
"""Up to 0.5 in slow slip, fading over 0.1 mm/s to 1 m/s; typical is 0.03 over 20 mm/s."""
