"""Lag of the position sensor: its low-pass filter."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def time_constant(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """Tau."""
    return p[0]


EFFECT = Effect(
    identifier="position_sensor_lag",
    kind=Kind.SENSOR,
    equation="tau x_m' + x_m = x",
    reference="First-order instrument: Doebelin, Measurement Systems, McGraw-Hill (2003), chapter 3",
    meaning="The position signal follows the part late and rounded, as through a filter.",
    look_at="the low-pass or averaging filter of the position sensor, which many have, and whether the "
    "position is recorded late",
    german=German(
        "Trägheit des Positionssensors",
        "Das Positionssignal folgt dem Teil verspätet und verrundet, wie durch ein Filter.",
        "das Tiefpass- oder Mittelungsfilter des Positionssensors, das viele haben, und ob die Position "
        "verspätet aufgezeichnet wird",
    ),
    phases=(Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.STOP),
    parameters=(Parameter("time_constant_s", "s", null=0.0, lower=0.0, upper=0.02, typical=0.0003),),
    laws={LawKind.POSITION_LAG: time_constant},
)
"""Up to 20 ms, the range of the force sensor's lag; typical is a bandwidth of 530 Hz."""
