"""Ageing of stiction: contacts creep, so static friction grows with the time at rest."""

from collections.abc import Sequence

import numpy as np

from impactcell.physics.effect import ONE, Covariates, Effect, Factors, German, Kind, Parameter, Phase
from impactcell.records import Samples


def factors(parameters: Sequence[Samples], shots: Covariates) -> Factors:
    """1 + b log10(dwell) on mu_s; 1 where the dwell is not known."""
    decades = np.log10(np.maximum(np.nan_to_num(shots.dwell_s, nan=1.0), 0.1))
    return Factors(1.0 + parameters[0] * decades, ONE, ONE)


EFFECT = Effect(
    identifier="stiction_ageing",
    kind=Kind.BETWEEN_SHOTS,
    equation="mu_s (1 + b log10 dwell_s), dwell at least 0.1 s",
    reference="Dieterich, Time-dependent friction in rocks, J. Geophys. Res. 77 (1972)",
    meaning="The longer the part rests, the harder it is to break loose.",
    look_at="waiting times before a tap, oil that is squeezed out, contacts that stick; tap "
    "after equal rests",
    german=German(
        "Altern der Haftung",
        "Je länger das Teil ruht, desto schwerer löst es sich.",
        "Wartezeiten vor dem Stoß, verdrängtes Öl, klebende Kontakte; nach gleichen Ruhezeiten stoßen",
    ),
    phases=(Phase.PRELOAD, Phase.BETWEEN_SHOTS),
    parameters=(Parameter("increase_per_decade", "1", null=0.0, lower=-0.2, upper=0.5, typical=0.03),),
    between=factors,
)
"""From a loss of a fifth to a gain of half a decade of time; typical is 3 %."""
