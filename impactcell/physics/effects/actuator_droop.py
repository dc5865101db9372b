"""Actuator droop: the actuator slows down under load."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def loss(w: float, force: float, _c: float, _d: float, p: FloatPointer) -> float:
    """W' = (c F - w) / tau."""
    return (p[0] * force - w) / p[1]


EFFECT = Effect(
    identifier="actuator_droop",
    kind=Kind.ACTUATOR,
    equation="y' = v - w, tau w' + w = c F",
    reference="Load regulation of a speed-controlled drive: Leonhard, Control of Electrical Drives, "
    "Springer (2001)",
    meaning="Under load the actuator slows down, and comes back to its speed only after a moment.",
    look_at="the drive: its current limit and the gain of its speed loop, a slipping belt or "
    "coupling, low air or oil pressure",
    german=German(
        "Geschwindigkeitseinbruch des Antriebs",
        "Unter Last wird der Antrieb langsamer; seine Geschwindigkeit hat er erst nach einem Moment wieder.",
        (
            "den Antrieb: Stromgrenze, Verstärkung des Geschwindigkeitsreglers, rutschender Riemen, "
            "zu wenig Luft- oder Öldruck"
        ),
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING),
    parameters=(
        Parameter("speed_loss_m_per_s_n", "m/(s N)", null=0.0, lower=0.0, upper=0.001, typical=5e-05),
        Parameter("time_constant_s", "s", null=math.nan, lower=1e-05, upper=1.0, typical=0.003),
    ),
    laws={LawKind.LOSS: loss},
)
"""At 100 N the upper end takes away 0.1 m/s, all the speed of a fast tap; typical takes 5 mm/s."""
