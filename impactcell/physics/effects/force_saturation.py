"""Saturation of the force channel: its amplifier or converter ends at a limit."""

import math

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def shown(force: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """min(F, F_max)."""
    return min(p[0], force)


EFFECT = Effect(
    identifier="force_saturation",
    kind=Kind.SENSOR,
    equation="min(F, F_max)",
    reference="Overrange of a measuring amplifier",
    meaning="The force signal is cut off at the top: above a limit the sensor shows no more.",
    look_at="the range of the force sensor, of its amplifier and of the converter; a range "
    "that ends well above the peak",
    german=German(
        "Sättigung des Kraftsignals",
        "Das Kraftsignal ist oben abgeschnitten: über einer Grenze zeigt der Sensor nicht mehr.",
        "den Messbereich von Kraftsensor, Verstärker und Wandler; er muss deutlich über der Spitze enden",
    ),
    phases=(Phase.LOADING, Phase.UNLOADING),
    parameters=(Parameter("limit_n", "N", null=math.inf, lower=1.0, upper=math.inf, typical=200.0),),
    laws={LawKind.READING: shown},
    order=3,
)
"""From below any tap to no limit; typical clips taps of 19 kg beyond some 0.05 m/s."""
