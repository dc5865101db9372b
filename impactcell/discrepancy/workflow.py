"""The whole workflow, one step a line: fit, locate, name, extend, prove, next experiment."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.data import noise_floor
from impactcell.discrepancy.data.prepared_campaign import PreparedCampaign, prepare, shot_set, split_held_out
from impactcell.discrepancy.data.shots import IndexArray, decimate
from impactcell.discrepancy.model.block_selection import decided_blocks, usable_blocks
from impactcell.discrepancy.model.fit import Fit, refit_shot_parameters
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.model.intervals import ParameterEstimate, estimate_parameters
from impactcell.discrepancy.model.linearisation import linearise
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.search.candidate_fits import Mapper, SearchContext
from impactcell.discrepancy.search.experiment_design import Proposal, propose_experiments
from impactcell.discrepancy.search.model_selection import SelectionResult, select_model
from impactcell.discrepancy.search.unexplained_gap import UnexplainedGap, describe_gap
from impactcell.discrepancy.search.validation import Validation, validate
from impactcell.physics import Kind, Plant
from impactcell.physics.effects import LIBRARY

NO_GAP, NAMED, TIED, UNKNOWN = "no_gap", "named", "tied", "unknown"
COARSE_SAMPLES = 400
"""Samples of a channel and shot that a search among many models reads."""


@dataclass(frozen=True, slots=True, eq=False)
class DiscrepancyResult:
    """Outcome of the workflow.

    Attributes
    ----------
    verdict : str
        `no_gap`, `named`, `tied` or `unknown`.
    training, held_out : Index
        Places of the shots.
    problem, held_problem : Problem
    nominal, final : Fit
        Fitted to the training shots.
    held_nominal, held_final : Fit
        The same with the held-out shots' own factors.
    parameters : tuple of Estimate
        Of the final model.
    """

    verdict: str
    prepared: PreparedCampaign
    floor: noise_floor.NoiseFloor
    replicates: noise_floor.ReplicateSpread
    training: IndexArray
    held_out: IndexArray
    problem: Problem
    held_problem: Problem
    nominal: Fit
    final: Fit
    held_nominal: Fit
    held_final: Fit
    selection: SelectionResult
    parameters: tuple[ParameterEstimate, ...]
    validation: Validation
    unexplained: UnexplainedGap | None
    experiments: tuple[Proposal, ...]
    seed: int

    @property
    def added(self) -> tuple[str, ...]:
        """Effects that joined the nominal model."""
        return self.selection.added


def investigate(
    campaign: Campaign,
    *,
    seed: int = 0,
    mapper: Mapper | None = None,
    plant: Plant | None = None,
    library: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> DiscrepancyResult:
    """Find where model and measurement disagree, name what is missing, add it and prove the gap shrinks.

    Parameters
    ----------
    campaign : Campaign
    seed : int
        Of the split and of every resampling.
    mapper : callable, optional
        `map` that may work in parallel; the outcome does not depend on it.
    plant : Plant, optional
        Nominal plant to start from; its effects stay in the model. Without it (1)-(3) with Coulomb friction.
    library : sequence of str, optional
        Effects that may be named; all of them without it.
    progress : callable, optional
        Called with the name of each step as it begins.

    Raises
    ------
    CampaignError
        The data cannot be used; the message says why and what to do.
    DiscrepancyError
        The nominal model cannot be fitted at all.
    """
    report_step = progress or (lambda _step: None)
    mapper_or_serial: Mapper = mapper or (lambda function, items: [function(item) for item in items])
    names = tuple(LIBRARY) if library is None else tuple(library)
    if campaign.excitation is Excitation.DRIVEN:
        # Blocks of one record share what acts between records; there are too few of those for any test.
        names = tuple(name for name in names if LIBRARY[name].kind is not Kind.BETWEEN_SHOTS)
    prepared = prepare(campaign)
    floor = noise_floor.sensor_noise(prepared)
    training, held_out = split_held_out(prepared, seed)
    problem = Problem(shot_set(prepared, training, floor.noise_std), len(prepared.batches))
    report_step("fitting the nominal model")
    nominal = fit_nominal(problem, plant)
    if campaign.excitation is Excitation.DRIVEN:
        kept = usable_blocks(problem, nominal)
        if len(kept) < len(training):
            note = (
                f"{len(training) - len(kept)} of {len(training)} training blocks were left out: in them "
                "stick ends, or does not, by so little that noise decides, or the nominal model does not "
                "follow them."
            )
            prepared = replace(prepared, notes=(*prepared.notes, note))
            training = training[kept]
            problem = Problem(shot_set(prepared, training, floor.noise_std), len(prepared.batches))
            nominal = fit_nominal(problem, plant)
    report_step("locating the gap and naming effects")
    fewer = decimate(problem.shots, COARSE_SAMPLES)
    coarse = problem if fewer is problem.shots else Problem(fewer, len(prepared.batches))
    selection = select_model(
        SearchContext(
            problem, coarse, prepared, names, seed, mapper_or_serial, _is_floor_certain(prepared, floor)
        ),
        nominal,
    )
    final = selection.accepted or nominal
    report_step("proving on held-out shots")
    held_problem = Problem(shot_set(prepared, held_out, floor.noise_std), len(prepared.batches))
    if campaign.excitation is Excitation.DRIVEN:
        held_out = held_out[decided_blocks(held_problem, refit_shot_parameters(held_problem, final))]
        held_problem = Problem(shot_set(prepared, held_out, floor.noise_std), len(prepared.batches))
    proof, replicates, held_nominal, held_final = _validate(
        prepared, floor, (problem, held_problem), nominal, final, (training, held_out), seed
    )
    linearisation = linearise(problem, final)
    verdict = _verdict(selection)
    report_step("planning the next experiment")
    return DiscrepancyResult(
        verdict=verdict,
        prepared=prepared,
        floor=floor,
        replicates=replicates,
        training=training,
        held_out=held_out,
        problem=problem,
        held_problem=held_problem,
        nominal=nominal,
        final=final,
        held_nominal=held_nominal,
        held_final=held_final,
        selection=selection,
        parameters=estimate_parameters(final, linearisation),
        validation=proof,
        unexplained=describe_gap(problem, selection.nominal) if verdict == UNKNOWN else None,
        experiments=propose_experiments(problem, final, _tied_models(selection)),
        seed=seed,
    )


def _is_floor_certain(prepared: PreparedCampaign, floor: noise_floor.NoiseFloor) -> bool:
    """Whether what is above the floor is a gap: noise is stated, or sampled fast enough to be seen."""
    return "stated" in floor.source or prepared.excitation is Excitation.TAP


def _verdict(selection: SelectionResult) -> str:
    if selection.accepted is None:
        return UNKNOWN
    if not selection.added:
        return NO_GAP
    return TIED if any(selection.ties.values()) else NAMED


def _validate(
    prepared: PreparedCampaign,
    floor: noise_floor.NoiseFloor,
    problems: tuple[Problem, Problem],
    nominal: Fit,
    final: Fit,
    places: tuple[IndexArray, IndexArray],
    seed: int,
) -> tuple[Validation, noise_floor.ReplicateSpread, Fit, Fit]:
    problem, held_problem = problems
    held = refit_shot_parameters(held_problem, final)
    log_factor = np.empty(len(prepared.shots))
    log_factor[places[0]] = final.shot_parameters.log_factor
    log_factor[places[1]] = held.shot_parameters.log_factor
    replicates = noise_floor.replicate_spread(prepared.shots, log_factor, len(prepared.batches))
    proof, held_nominal, held_final = validate(problem, nominal, final, held_problem, floor, replicates, seed)
    return proof, replicates, held_nominal, held_final


def _tied_models(selection: SelectionResult) -> list[tuple[str, str, Fit]]:
    models = []
    for effect, rivals in selection.ties.items():
        for rival in rivals:
            tied_set = {rival if name == effect else name for name in selection.added}
            for alternative in selection.alternatives:
                if set(alternative.effects) >= tied_set and len(alternative.effects) == len(
                    selection.accepted.effects if selection.accepted else ()
                ):
                    models.append((effect, rival, alternative.fit))
                    break
    return models


def extended_plant(result: DiscrepancyResult) -> Plant:
    """Plant of the final model."""
    values = {
        ("", estimate.parameter): estimate.value for estimate in result.parameters if not estimate.effect
    }
    effects: dict[str, dict[str, float | Sequence[float]]] = {}
    for estimate in result.parameters:
        if not estimate.effect:
            continue
        values_of_effect = effects.setdefault(estimate.effect, {})
        if estimate.batch:
            values_of_effect[estimate.parameter] = (
                *_batch_values(values_of_effect.get(estimate.parameter)),
                estimate.value,
            )
        else:
            values_of_effect[estimate.parameter] = estimate.value
    mu_k = values["", "mu_k"]
    ratio = values.get(("", "ratio"), 1.0)
    return Plant(
        stiffness_n_per_m=values.get(("", "stiffness_n_per_m"), 6e5),
        damping_n_s_per_m=values.get(("", "damping_n_s_per_m"), 0.0),
        mu_s=mu_k * ratio,
        mu_k=mu_k,
        gravity_m_s2=result.prepared.gravity_m_s2,
        effects=effects,
    )


def _batch_values(value: float | Sequence[float] | None) -> Sequence[float]:
    return value if isinstance(value, Sequence) else ()
