"""Forces of a fitted model by the state of the machine: anywhere, and at rest."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.records.motion_scale import (
    MotionScale,
    carried_load,
)
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.terms.catalogue import MotionState
from impactcell.discrepancy.machine.terms.law_terms import term_of
from impactcell.records import Samples


def law_of(
    model: FittedModel, covariates: Mapping[str, Samples]
) -> Callable[[Samples, Samples, Samples], list[Samples]]:
    """Sum of all smooth forces, and level of friction, of position, velocity and load: shape (n,) each."""
    parts = [
        (term_of(chosen.choice), chosen, np.array([model.value(column) for column in chosen.columns]))
        for chosen in model.terms
    ]

    def law(position: Samples, velocity: Samples, load: Samples) -> list[Samples]:
        sums = [np.zeros(position.shape), np.zeros(position.shape)]
        motions_by = {
            name: MotionState(position, velocity, load, column) for name, column in covariates.items()
        }
        for term, chosen, strengths in parts:
            features = term.features(motions_by[chosen.choice.covariate], chosen.shape)
            sums[term.is_friction] += (
                strengths @ features if len(strengths) > 1 else strengths[0] * features[0]
            )
        return sums

    return law


def friction_at_rest(model: FittedModel, records: Sequence[UniformRecord], scale: MotionScale) -> float:
    """Mean level of a model's friction where the part would rest, over all places of all records."""
    levels = []
    for record in records:
        still = np.zeros(record.position.shape)
        load = carried_load(model.base.response, record, record.force, (model.gravity, scale))
        columns = {
            term.choice.covariate: still + record.covariates.get(term.choice.covariate, 0.0)
            for term in model.terms
        }
        _, friction = law_of(model, columns)(record.position, still, load)
        levels.append(float(friction.mean()))
    return float(np.mean(levels))
