"""Zero error of the force sensor."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def shown(force: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """F + F_0."""
    return force + p[0]


EFFECT = Effect(
    identifier="force_sensor_offset",
    kind=Kind.SENSOR,
    equation="F + F_0",
    reference="Zero error: ISO 376 (2011)",
    meaning="The force sensor does not show zero when nothing touches it.",
    look_at="the zero of the force sensor: tare it unloaded, and look for preload, drift with "
    "temperature, a cable that pulls",
    german=German(
        "Nullpunktfehler des Kraftsensors",
        "Der Kraftsensor zeigt nicht null, wenn ihn nichts berührt.",
        "den Nullpunkt des Kraftsensors: unbelastet tarieren; Vorspannung, Temperaturdrift, ziehendes Kabel",
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.STOP),
    parameters=(Parameter("offset_n", "N", null=0.0, lower=-100.0, upper=100.0, typical=2.0),),
    laws={LawKind.READING: shown},
    order=2,
)
"""Up to the force of a slow tap either way; typical is 1 % of a fast one."""
