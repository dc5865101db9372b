"""Channel skew: force is recorded late against position."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def delay(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """Return the delay."""
    return p[0]


EFFECT = Effect(
    identifier="channel_skew",
    kind=Kind.SENSOR,
    equation="force recorded at t is that of t - delay",
    reference="Inter-channel delay of multiplexed converters: IEEE 1057 (2017)",
    meaning="Force and position are not recorded at the same time: one comes later than the other.",
    look_at="the two channels' filters and converters, and the trigger: let both record one sharp event",
    german=German(
        "Zeitversatz der Kanäle",
        "Kraft und Position werden nicht gleichzeitig aufgezeichnet: ein Kanal kommt später.",
        "Filter und Wandler beider Kanäle und den Trigger: beide ein scharfes Ereignis aufzeichnen lassen",
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING),
    parameters=(Parameter("delay_s", "s", null=0.0, lower=-0.01, upper=0.01, typical=0.0003),),
    laws={LawKind.DELAY: delay},
)
"""Up to the duration of a loading either way; typical is three samples at 10 kHz."""
