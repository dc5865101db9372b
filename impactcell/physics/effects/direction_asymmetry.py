"""Direction asymmetry: friction differs between the two directions of slip."""

from collections.abc import Sequence

from impactcell.physics.effect import ONE, Covariates, Effect, Factors, German, Kind, Parameter, Phase
from impactcell.records import Samples


def factors(parameters: Sequence[Samples], shots: Covariates) -> Factors:
    """1 + a direction on mu_s and mu_k."""
    factor = 1.0 + parameters[0] * shots.direction
    return Factors(factor, factor, ONE)


EFFECT = Effect(
    identifier="direction_asymmetry",
    kind=Kind.BETWEEN_SHOTS,
    equation="mu (1 + a direction)",
    reference="Ratchet-like asperities: Zmitrowicz, Models of kinematics dependent anisotropic "
    "friction, Int. J. Solids Struct. 39 (2002)",
    meaning="The part slides more easily one way than the other.",
    look_at="the lay of the machining marks, burrs on the part's edge, hoses or cables that pull one way",
    german=German(
        "Richtungsabhängigkeit",
        "Das Teil gleitet in einer Richtung leichter als in der anderen.",
        "die Richtung der Bearbeitungsspuren, Grate am Teil, einseitig ziehende Schläuche oder Kabel",
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE, Phase.BETWEEN_SHOTS),
    parameters=(Parameter("relative_amplitude", "1", null=0.0, lower=-0.5, upper=0.5, typical=0.03),),
    between=factors,
)
"""Up to three times the friction one way as the other; typical is 3 % each way."""
