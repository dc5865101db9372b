"""Viscous friction: a lubricated surface resists in proportion to the speed."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def resistance(_a: float, v: float, _c: float, _d: float, p: FloatPointer) -> float:
    """-k_v x'."""
    return -p[0] * v


EFFECT = Effect(
    identifier="viscous_friction",
    kind=Kind.FRICTION,
    equation="-k_v x'",
    reference="Equation (2) of the source paper; Olsson et al., Friction models and friction "
    "compensation, Eur. J. Control 4 (1998)",
    meaning="Resistance grows in proportion to the speed, as in oil.",
    look_at="lubrication: more oil or a thicker one than the model was made with, its "
    "temperature, a sealed guide",
    german=German(
        "Viskose Reibung",
        "Der Widerstand wächst im Verhältnis zur Geschwindigkeit, wie in Öl.",
        "die Schmierung: mehr oder zäheres Öl als beim Modell, seine Temperatur, eine gedichtete Führung",
    ),
    phases=(Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.DRIVEN),
    parameters=(
        Parameter("viscous_coefficient_n_s_per_m", "N s/m", null=0.0, lower=0.0, upper=1000.0, typical=60.0),
    ),
    laws={LawKind.BODY: resistance},
    dissipates=True,
)
"""At 0.1 m/s the upper end resists with 100 N, more than dry friction of 40 kg; typical with 6 N."""
