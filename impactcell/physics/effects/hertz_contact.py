"""Hertzian contact: the contact stiffens as its area grows."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def stiffening(d: float, _b: float, k: float, _d: float, p: FloatPointer) -> float:
    """K d^n - k d, odd in d."""
    return k * (math.copysign(abs(d) ** p[0], d) - d)


EFFECT = Effect(
    identifier="hertz_contact",
    kind=Kind.CONTACT,
    equation="k d^n, n free (k in N/m^n)",
    reference="Johnson, Contact Mechanics, Cambridge (1985), chapter 4",
    meaning="The contact gets stiffer the harder it is pressed, as of a round tip on a plane.",
    look_at="the shape of actuator tip and part where they touch: a ball or an edge, a soft "
    "layer, contact that is not plane",
    german=German(
        "Hertzscher Kontakt",
        "Der Kontakt wird steifer, je fester gedrückt wird, wie eine runde Spitze auf einer Ebene.",
        "die Form von Stößel und Teil an der Berührung: Kugel oder Kante, weiche Schicht, unebener Kontakt",
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING),
    parameters=(Parameter("exponent", "1", null=1.0, lower=0.7, upper=1.8, typical=1.1),),
    laws={LawKind.CONTACT: stiffening},
)
"""From softening to beyond a sphere on a plane, 1.5; typical is slightly curved."""
