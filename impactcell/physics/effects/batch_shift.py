"""Batch shift: every batch of material has its own friction."""

from collections.abc import Sequence

import numpy as np

from impactcell.physics.effect import ONE, Covariates, Effect, Factors, German, Kind, Parameter, Phase
from impactcell.records import Samples


def factors(parameters: Sequence[Samples], shots: Covariates) -> Factors:
    """1 + shift of the shot's batch on mu_s and mu_k; the first batch is the reference."""
    shift = parameters[0]
    padded = np.concatenate([np.zeros((*shift.shape[:-1], 1)), shift], axis=-1)
    chosen = np.take_along_axis(padded, shots.batch.astype(np.int64)[:, None], axis=-1)[:, 0]
    return Factors(1.0 + chosen, 1.0 + chosen, ONE)


EFFECT = Effect(
    identifier="batch_shift",
    kind=Kind.BETWEEN_SHOTS,
    equation="one factor 1 + r of mu a batch, the first batch is the reference",
    reference="Analysis of variance, one fixed factor",
    meaning="One batch of material has more friction than another.",
    look_at="what differs between the batches: coating, oil, surface finish, supplier, storage",
    german=German(
        "Chargenunterschied",
        "Eine Werkstoffcharge hat mehr Reibung als eine andere.",
        "was die Chargen unterscheidet: Beschichtung, Öl, Oberfläche, Lieferant, Lagerung",
    ),
    phases=(Phase.BETWEEN_SHOTS,),
    parameters=(
        Parameter("relative_change", "1", null=0.0, lower=-0.9, upper=0.9, typical=0.05, per_batch=True),
    ),
    between=factors,
)
"""Friction stays above zero; typical is 5 % from batch to batch."""
