"""Error of the mass the shot was recorded with."""

from collections.abc import Sequence

from impactcell.physics.effect import ONE, Covariates, Effect, Factors, German, Kind, Parameter, Phase
from impactcell.records import Samples


def factors(parameters: Sequence[Samples], _shots: Covariates) -> Factors:
    """1 + e on the mass."""
    return Factors(ONE, ONE, 1.0 + parameters[0])


EFFECT = Effect(
    identifier="mass_error",
    kind=Kind.BODY,
    equation="m (1 + e)",
    reference="Fixture or cover that moves with the part but was not weighed",
    meaning="More or less mass moves than was entered.",
    look_at="the part's mass: weigh it, with everything that moves along (fixture, cover, coupling)",
    german=German(
        "Falsche Masse",
        "Es bewegt sich mehr oder weniger Masse als eingetragen.",
        "die Masse des Teils: wiegen, mit allem, was sich mitbewegt (Aufnahme, Deckel, Kupplung)",
    ),
    phases=(Phase.PRELOAD, Phase.LOADING, Phase.UNLOADING),
    parameters=(Parameter("relative_error", "1", null=0.0, lower=-0.5, upper=0.5, typical=0.03),),
    between=factors,
)
"""Half to one and a half of the stated mass; typical is 3 %."""
