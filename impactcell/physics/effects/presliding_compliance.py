"""Presliding compliance: stick is a spring until it breaks away; after a stop it re-anchors without force."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def stiffness(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """s0."""
    return p[0]


EFFECT = Effect(
    identifier="presliding_compliance",
    kind=Kind.FRICTION,
    equation="elastic stick of stiffness s0 up to mu_s m g",
    reference="Courtney-Pratt and Eisner, The effect of a tangential force on the contact of "
    "metallic bodies, Proc. R. Soc. A 238 (1957)",
    meaning="Before it breaks loose the part already gives way a little, like a spring.",
    look_at="soft layers beneath the part, a fixture that bends, a sensor fastened to "
    "something other than the part",
    german=German(
        "Nachgeben vor dem Gleiten",
        "Bevor es losbricht, gibt das Teil schon ein wenig nach, wie eine Feder.",
        "weiche Schichten unter dem Teil, eine nachgebende Aufnahme, einen anderswo befestigten Sensor",
    ),
    phases=(Phase.PRELOAD, Phase.STOP, Phase.DRIVEN),
    parameters=(
        Parameter(
            "stiffness_n_per_m", "N/m", null=math.inf, lower=100000.0, upper=math.inf, typical=10000000.0
        ),
    ),
    laws={LawKind.STICK: stiffness},
)
"""From 0.4 mm of give before a part of 20 kg slips to none; typical gives 4 µm."""
