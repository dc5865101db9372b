"""The shots that the search never saw, opened once."""

from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data import (
    IndexArray,
    NoiseFloor,
    PreparedCampaign,
    ReplicateSpread,
    replicate_spread,
)
from impactcell.discrepancy.model import Fit, Problem, refit_shot_parameters
from impactcell.discrepancy.search.candidate_fits import is_at_bound
from impactcell.discrepancy.search.confirmation import NestedModels, confirmed
from impactcell.discrepancy.search.gap_measure import MAX_P_VALUE, GapMeasure
from impactcell.discrepancy.search.validation import Validation, counted_parts


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutOutcome:
    """What held-out shots say.

    Attributes
    ----------
    final : Fit
        The model with the effects that they confirm.
    held_nominal, held_final : Fit
        The nominal model and this one with the held-out shots' own numbers.
    replicates : ReplicateSpread
        Of the friction factors about the law of the largest model.
    validation : Validation
    """

    final: Fit
    held_nominal: Fit
    held_final: Fit
    replicates: ReplicateSpread
    validation: Validation


@dataclass(frozen=True, slots=True, eq=False)
class OpenedShots:
    """Training shots and held-out ones.

    Attributes
    ----------
    indices : tuple of ndarray
        Of training and held-out shots in the campaign.
    problems : tuple of Problem
        The same.
    """

    prepared: PreparedCampaign
    floor: NoiseFloor
    indices: tuple[IndexArray, IndexArray]
    problems: tuple[Problem, Problem]
    seed: int

    def validate(self, nested: NestedModels, max_p: float = MAX_P_VALUE) -> HeldOutOutcome:
        """Add effects to the nominal model as long as held-out shots confirm them.

        None where what they confirm by itself is no name: a shape at the end of its range.

        Parameters
        ----------
        nested : NestedModels
            The effects, and the models with and without them, fitted to the training shots.
        max_p : float
            One-sided error for each of them.
        """
        problem, held_problem = self.problems
        held = {names: refit_shot_parameters(held_problem, model) for names, model in nested.models.items()}
        held_nested = replace(nested, models=held)
        replicates = self._replicates(nested.largest, held_nested.largest)
        measure = GapMeasure(held_problem, self.floor, replicates, self.seed)
        training = GapMeasure(problem, self.floor, replicates, self.seed)
        changes = confirmed(
            measure, held_nested, max_p, lambda effects: training.gap(nested.models[effects]).trace
        )
        if is_at_bound(problem.shots, nested.models[frozenset(changes)], nested.nominal.effects):
            changes = {}
        nominal, held_nominal = nested.nominal, held_nested.nominal
        final, held_final = nested.models[frozenset(changes)], held[frozenset(changes)]
        parts = counted_parts(measure, (held_nominal, held_final), changes.values())
        validation = Validation(
            training.gap(nominal),
            training.gap(final),
            measure.change(held_nominal, held_final, parts),
            changes,
            measure.expected(held_final),
            measure.is_at_floor(held_final) and training.is_at_floor(final),
            measure.regions(held_nominal, held_final),
        )
        return HeldOutOutcome(final, held_nominal, held_final, replicates, validation)

    def _replicates(self, trained: Fit, held: Fit) -> ReplicateSpread:
        log_factor = np.empty(len(self.prepared.shots))
        for indices, model in zip(self.indices, (trained, held), strict=True):
            log_factor[indices] = model.shot_parameters.log_factor
        return replicate_spread(self.prepared.shots, log_factor, len(self.prepared.batches))
