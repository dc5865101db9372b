"""Restoring force: a spring, a cable or a membrane pulls the part towards x = 0."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def spring(x: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:
    """-k_r x."""
    return -p[0] * x


EFFECT = Effect(
    identifier="restoring_force",
    kind=Kind.BODY,
    equation="-k_r x on the part",
    reference="Hooke's law",
    meaning="A spring-like force pulls the part back to where it started.",
    look_at="cables, hoses, bellows, seals and springs fastened to the part, and whether they are tight",
    german=German(
        "Rückstellkraft",
        "Eine Kraft wie von einer Feder zieht das Teil dorthin zurück, wo es begann.",
        "Kabel, Schläuche, Bälge, Dichtungen und Federn am Teil, und ob sie gespannt sind",
    ),
    phases=(Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.DRIVEN),
    parameters=(
        Parameter("stiffness_n_per_m", "N/m", null=0.0, lower=-5000.0, upper=20000.0, typical=500.0),
    ),
    laws={LawKind.BODY: spring},
)
"""From 5 N/mm outwards to 20 N/mm back; typical pulls 1 N after a slide of 2 mm."""
