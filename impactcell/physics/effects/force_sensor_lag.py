"""Lag of the force sensor: its amplifier is a low-pass filter."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def time_constant(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """Tau."""
    return p[0]


EFFECT = Effect(
    identifier="force_sensor_lag",
    kind=Kind.SENSOR,
    equation="tau F_m' + F_m = F",
    reference="First-order instrument: Doebelin, Measurement Systems, McGraw-Hill (2003), chapter 3",
    meaning="The force signal follows the force late and rounded, as through a filter.",
    look_at="the low-pass filter of the force amplifier: its cut-off may be too low for a tap "
    "of some milliseconds",
    german=German(
        "Trägheit des Kraftsensors",
        "Das Kraftsignal folgt der Kraft verspätet und verrundet, wie durch ein Filter.",
        "das Tiefpassfilter des Kraftverstärkers: für einen Stoß von Millisekunden vielleicht zu tief",
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING),
    parameters=(Parameter("time_constant_s", "s", null=0.0, lower=0.0, upper=0.02, typical=0.0003),),
    laws={LawKind.LAG: time_constant},
)
"""Up to 20 ms, beyond which a loading of 8 ms leaves no peak; typical is a bandwidth of 530 Hz."""
