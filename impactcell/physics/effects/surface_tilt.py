"""Tilted surface: gravity has a component along the axis; the normal force stays m g."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def downhill(_a: float, _b: float, m: float, g: float, p: FloatPointer) -> float:
    """-m g sin(a)."""
    return -m * g * math.sin(p[0])


EFFECT = Effect(
    identifier="surface_tilt",
    kind=Kind.BODY,
    equation="-m g sin(a), a > 0 uphill along +1",
    reference="Newtonian mechanics of the inclined plane",
    meaning="The table is not level: gravity helps the part one way and hinders it the other.",
    look_at="the table with a level along the axis; tilt is named in radians, 0.001 rad is 1 mm in a metre",
    german=German(
        "Neigung des Tisches",
        "Der Tisch ist nicht waagerecht: die Schwerkraft hilft in einer Richtung und hindert in der anderen.",
        "den Tisch mit einer Wasserwaage entlang der Achse; genannt in Radiant, 0,001 rad ist 1 mm je Meter",
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.STOP, Phase.DRIVEN),
    parameters=(Parameter("tilt_rad", "rad", null=0.0, lower=-0.1, upper=0.1, typical=0.005),),
    laws={LawKind.BODY: downhill},
)
"""Up to where a slope takes half of a friction of 0.2; typical is 5 mm/m."""
