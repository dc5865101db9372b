"""Gain error of the force sensor."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def shown(force: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """F (1 + e)."""
    return force * (1.0 + p[0])


EFFECT = Effect(
    identifier="force_sensor_gain",
    kind=Kind.SENSOR,
    equation="F (1 + e)",
    reference="Span error: ISO 376 (2011)",
    meaning="The force sensor shows every force too large or too small by the same per cent.",
    look_at="the force sensor's calibration: load it with a known weight, and compare the "
    "scale factor that was entered",
    german=German(
        "Verstärkungsfehler des Kraftsensors",
        "Der Kraftsensor zeigt jede Kraft um denselben Anteil zu groß oder zu klein.",
        "die Kalibrierung des Kraftsensors: mit bekanntem Gewicht belasten, eingetragenen Faktor prüfen",
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING),
    parameters=(Parameter("relative_error", "1", null=0.0, lower=-0.5, upper=0.5, typical=0.03),),
    laws={LawKind.READING: shown},
    order=1,
)
"""Half to one and a half of the force; typical is 3 %."""
