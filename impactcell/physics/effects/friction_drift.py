"""Friction that drifts from the first shot to the last."""

from collections.abc import Sequence

from impactcell.physics.effect import ONE, Covariates, Effect, Factors, German, Kind, Parameter, Phase
from impactcell.records import Samples


def factors(parameters: Sequence[Samples], shots: Covariates) -> Factors:
    """1 + c (shot/N - 1/2) on mu_s and mu_k."""
    factor = 1.0 + parameters[0] * (shots.shot / shots.shots - 0.5)
    return Factors(factor, factor, ONE)


EFFECT = Effect(
    identifier="friction_drift",
    kind=Kind.BETWEEN_SHOTS,
    equation="mu (1 + c (shot/N - 1/2))",
    reference="Running-in and wear: Blau, On the nature of running-in, Tribol. Int. 38 (2005)",
    meaning="Friction changes slowly from the first shot to the last.",
    look_at="what changes over a campaign: wear, running-in, temperature, dirt, oil that is used up",
    german=German(
        "Reibungsdrift",
        "Die Reibung ändert sich langsam vom ersten bis zum letzten Stoß.",
        "was sich über die Messung ändert: Verschleiß, Einlaufen, Temperatur, Schmutz, verbrauchtes Öl",
    ),
    phases=(Phase.BETWEEN_SHOTS,),
    parameters=(Parameter("relative_change", "1", null=0.0, lower=-0.9, upper=0.9, typical=0.05),),
    between=factors,
)
"""Friction stays above zero; typical is 5 % over a campaign."""
