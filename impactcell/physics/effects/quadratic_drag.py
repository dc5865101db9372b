"""Quadratic drag: a fluid is pushed aside."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def drag(_a: float, v: float, _c: float, _d: float, p: FloatPointer) -> float:
    """-c x' abs(x')."""
    return -p[0] * v * abs(v)


EFFECT = Effect(
    identifier="quadratic_drag",
    kind=Kind.BODY,
    equation="-c x' abs(x')",
    reference="Rayleigh, On the resistance of fluids, Phil. Mag. 2 (1876)",
    meaning="Something is pushed aside: resistance grows with the square of the speed.",
    look_at="fluid or air around the part: coolant on the table, a film that piles up in "
    "front, a closed volume that is emptied",
    german=German(
        "Quadratischer Widerstand",
        "Etwas wird verdrängt: der Widerstand wächst mit dem Quadrat der Geschwindigkeit.",
        (
            "Flüssigkeit oder Luft um das Teil: Kühlmittel auf dem Tisch, ein Film, der sich staut, "
            "ein Hohlraum, der sich leert"
        ),
    ),
    phases=(Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.DRIVEN),
    parameters=(
        Parameter("drag_coefficient_n_s2_per_m2", "N s²/m²", null=0.0, lower=0.0, upper=5000.0, typical=50.0),
    ),
    laws={LawKind.BODY: drag},
    dissipates=True,
)
"""At 0.1 m/s the upper end resists like 500 N s/m; typical like 5."""
