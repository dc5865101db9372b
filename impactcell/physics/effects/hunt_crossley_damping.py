"""Hunt-Crossley damping: the contact's damping grows with its indentation, on approach and departure."""

from impactcell.numerics.jit import FloatPointer
from impactcell.physics.effect import Effect, German, Kind, LawKind, Parameter, Phase


def damping(d: float, rate: float, _c: float, _d: float, p: FloatPointer) -> float:
    """C d d'."""
    return p[0] * d * rate


EFFECT = Effect(
    identifier="hunt_crossley_damping",
    kind=Kind.CONTACT,
    equation="c d d' beside b, on approach and departure",
    reference="Hunt and Crossley, Coefficient of restitution interpreted as damping in vibroimpact, "
    "J. Appl. Mech. 42 (1975)",
    meaning="The contact takes up more energy the deeper it is pressed in.",
    look_at="what lies between actuator and part: rubber, plastic, a soft pad, a loose tip",
    german=German(
        "Dämpfung nach Hunt und Crossley",
        "Der Kontakt nimmt umso mehr Energie auf, je tiefer er eingedrückt wird.",
        "was zwischen Stößel und Teil liegt: Gummi, Kunststoff, weiche Auflage, lose Spitze",
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING),
    parameters=(
        Parameter("damping_n_s_per_m2", "N s/m²", null=0.0, lower=0.0, upper=20000000.0, typical=500000.0),
    ),
    laws={LawKind.CONTACT: damping},
    dissipates=True,
)
"""Indented by 0.3 mm, the upper end damps like 6000 N s/m, nearly critically; typical like 150."""
