"""Actuator ramp: the actuator needs time to reach its speed."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def run_up(t: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """min(t / t_r, 1)."""
    return t / p[0] if t < p[0] else 1.0


def end(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """t_r."""
    return p[0]


EFFECT = Effect(
    identifier="actuator_ramp",
    kind=Kind.ACTUATOR,
    equation="y' grows linearly from 0 to v in t_r",
    reference="Trapezoidal velocity profile of motion controllers",
    meaning="The actuator has not reached its speed when it meets the part; it is still speeding up.",
    look_at="the drive's acceleration limit, and the free travel before contact: start "
    "farther away, or speed up faster",
    german=German(
        "Anlauf des Antriebs",
        "Der Antrieb hat seine Geschwindigkeit noch nicht erreicht, wenn er das Teil trifft.",
        (
            "die Beschleunigungsgrenze des Antriebs und den freien Weg vor der Berührung: weiter entfernt "
            "beginnen oder schneller beschleunigen"
        ),
    ),
    phases=(Phase.PRELOAD, Phase.LOADING),
    parameters=(Parameter("ramp_time_s", "s", null=0.0, lower=0.0, upper=0.05, typical=0.002),),
    laws={LawKind.SPEED: run_up, LawKind.UNTIL: end},
)
"""Up to 50 ms, longer than a part is in contact; typical is a quarter of its loading."""
