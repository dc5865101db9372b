"""The whole workflow, one step a line: fit, locate, name, extend, prove, next experiment."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from impactcell.campaign import Campaign
from impactcell.discrepancy.data import (
    CellLimits,
    IndexArray,
    NoiseFloor,
    PreparedCampaign,
    ReplicateSpread,
    prepare,
    sensor_noise,
    split_held_out,
)
from impactcell.discrepancy.laws import LawFinding, estimate_effects, find_law, hold_against_free_forms
from impactcell.discrepancy.model import (
    PLANT_PARAMETERS,
    Fit,
    ParameterEstimate,
    Problem,
    decided_blocks,
    join_intervals,
    linearise,
    profile_parameters,
    refit_shot_parameters,
)
from impactcell.discrepancy.nominal_model import nominal_models, problem_of
from impactcell.discrepancy.open_records import find_basis
from impactcell.discrepancy.search import (
    MAX_P_VALUE,
    UNKNOWN,
    UNLIMITED,
    Conclusion,
    GapMeasure,
    HeldOutOutcome,
    Mapper,
    ModelEvidence,
    NestedModels,
    OpenedShots,
    Proposal,
    SearchContext,
    SelectionResult,
    Simulation,
    UnexplainedGap,
    Validation,
    conclude,
    describe_gap,
    estimate_beside_error,
    exchanged,
    missing_shots,
    nested_models,
    only_test,
    propose_experiments,
    select_model,
    shared_error,
    simulate_held_out,
    tied_models,
)
from impactcell.physics import Kind, Plant
from impactcell.physics.effects import LIBRARY
from impactcell.physics.free_motion import depends_on_mass


@dataclass(frozen=True, slots=True, eq=False)
class DiscrepancyResult:
    """Outcome of the workflow.

    Attributes
    ----------
    conclusion : Conclusion
        What is established, and what remains.
    training, held_out : IndexArray
        Places of the shots.
    problem, held_problem : Problem
    nominal, final : Fit
        Fitted to the training shots.
    held_nominal, held_final : Fit
        The same with the held-out shots' own factors.
    parameters : tuple of ParameterEstimate
        Of the final model.
    stated_parameters : tuple of ParameterEstimate
        The same as the report states them: those of its effects beside a free form of what remains, if
        anything does, and with intervals that hold also for every model that is tied with it.
    law : LawFinding or None
        Where something remains, the law that may be missing; None where nothing does, or nothing can be said.
    plant : Plant or None
        Nominal plant that was given.
    limits : CellLimits
        Of the cell in which the next experiment would be made.
    """

    conclusion: Conclusion
    prepared: PreparedCampaign
    floor: NoiseFloor
    replicates: ReplicateSpread
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
    stated_parameters: tuple[ParameterEstimate, ...]
    validation: Validation
    simulation: Simulation
    unexplained: UnexplainedGap | None
    experiments: tuple[Proposal, ...]
    law: LawFinding | None
    plant: Plant | None
    seed: int
    limits: CellLimits = UNLIMITED

    @property
    def verdict(self) -> str:
        """Return `no_gap`, `named`, `tied`, `unknown` or `untested`."""
        return self.conclusion.verdict

    @property
    def added(self) -> tuple[str, ...]:
        """Effects that joined the nominal model."""
        return self.conclusion.established

    @property
    def unseen(self) -> tuple[str, ...]:
        """Parameters of the nominal plant of which shots of this excitation tell nothing."""
        free = self.prepared.excitation.free_plant_parameters
        return tuple(name for name in PLANT_PARAMETERS if name not in free)

    @property
    def per_kilogram(self) -> tuple[str, ...]:
        """Effects of the final model that are known for a part of 1 kg only, as nothing told the mass."""
        if not self.prepared.lacks_mass:
            return ()
        return tuple(name for name in self.final.effects if depends_on_mass(name))

    @property
    def has_whole_plant(self) -> bool:
        """Whether the plant is known as a whole: by the shots, or as it was given."""
        return not self.per_kilogram and (self.plant is not None or not self.unseen)


def investigate(
    campaign: Campaign,
    *,
    seed: int = 0,
    mapper: Mapper | None = None,
    plant: Plant | None = None,
    library: Sequence[str] | None = None,
    limits: CellLimits = UNLIMITED,
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
    limits : CellLimits
        Of the cell in which a next experiment would be made.
    progress : callable, optional
        Called with the name of each step as it begins.

    Raises
    ------
    CampaignError
        The data cannot be used, or not with this plant; the message says why and what to do.
    DiscrepancyError
        The nominal model cannot be fitted at all.
    """
    report_step = progress or (lambda _step: None)
    prepared = prepare(campaign)
    floor = sensor_noise(prepared)
    training, held_out = split_held_out(prepared, seed)
    report_step("fitting the nominal model")
    nominals = nominal_models(prepared, floor, training, plant)
    start = nominals.start
    training = start.training
    missing = missing_shots(len(training), len(held_out))
    context = SearchContext(
        start.problem,
        start.coarse,
        start.prepared,
        _nameable(prepared, library),
        seed,
        mapper or (lambda function, items: [function(item) for item in items]),
        # What is above the floor is a gap where noise is stated, or sampled fast enough to be seen.
        floor_is_certain="stated" in floor.source or prepared.excitation.floor_is_certain,
    )
    report_step("locating the gap and naming effects")
    basis = find_basis(context, nominals, only_test if missing else select_model)
    context, selection = basis.context, basis.selection
    prepared, problem, nominal = basis.nominal.prepared, basis.nominal.problem, basis.nominal.fit
    if not missing:
        report_step("holding names against free forms")
        selection = hold_against_free_forms(context, selection)
    nested = nested_models(context, selection)
    report_step("proving on held-out shots")
    held_problem = problem_of(prepared, floor, held_out)
    if prepared.excitation.selects_blocks:
        largest = refit_shot_parameters(held_problem, nested.largest)
        held_out = held_out[decided_blocks(held_problem, largest)]
        held_problem = problem_of(prepared, floor, held_out)
        missing = missing or missing_shots(len(training), len(held_out))
    opened = OpenedShots(prepared, floor, (training, held_out), (problem, held_problem), seed)
    outcome = opened.validate(NestedModels({frozenset(): nominal}) if missing else nested)
    search_evidence = selection
    if not missing and len(outcome.validation.of_effects) < len(selection.added):
        selection, outcome = _confirmed_rival(context, selection, opened, outcome)
    final = outcome.final
    evidence = _evidence(context, search_evidence, final)
    conclusion = conclude(selection, evidence, outcome.validation, missing)
    law: LawFinding | None = None
    if not conclusion.remaining.explained and not missing:
        report_step("looking for a law that nobody has listed")
        measure = GapMeasure(held_problem, floor, outcome.replicates, seed)
        base = (problem, context.coarse, final)
        law = find_law(base, measure, outcome.held_final, seed, selection.outdone)
    report_step("planning the next experiment")
    parameters = profile_parameters(problem, final, linearise(problem, final), shared_error(evidence))
    stated = (
        *(one for one in parameters if not one.effect),
        *estimate_effects(context, evidence, parameters, selection.nominal),
    )
    tied = tied_models(selection, conclusion.established)
    for _effect, _rival, model in tied:
        stated = join_intervals(stated, estimate_beside_error(problem, model, prepared))
    return DiscrepancyResult(
        conclusion=conclusion,
        prepared=replace(prepared, notes=(*prepared.notes, *basis.notes_of(final, conclusion.remaining))),
        floor=floor,
        replicates=outcome.replicates,
        training=training,
        held_out=held_out,
        problem=problem,
        held_problem=held_problem,
        nominal=nominal,
        final=final,
        held_nominal=outcome.held_nominal,
        held_final=outcome.held_final,
        selection=selection,
        parameters=parameters,
        stated_parameters=stated,
        validation=outcome.validation,
        simulation=simulate_held_out(held_problem, nominal, final),
        unexplained=describe_gap(problem, selection.nominal) if conclusion.verdict == UNKNOWN else None,
        experiments=propose_experiments(
            problem, final, tied, prepared.batches, limits, conclusion.ties, remains=selection.remains
        ),
        law=law,
        plant=plant,
        seed=seed,
        limits=limits,
    )


def _confirmed_rival(
    context: SearchContext, selection: SelectionResult, opened: OpenedShots, outcome: HeldOutOutcome
) -> tuple[SelectionResult, HeldOutOutcome]:
    """Exchange what held-out shots do not confirm for what is tied with it and they do, if there is any.

    The error of a rival's test is shared among all of them.
    """
    variants = exchanged(selection)
    for variant in variants:
        tried = opened.validate(nested_models(context, variant), MAX_P_VALUE / len(variants))
        if len(tried.validation.of_effects) > len(outcome.validation.of_effects):
            selection, outcome = variant, tried
    return selection, outcome


def _evidence(context: SearchContext, selection: SelectionResult, final: Fit) -> ModelEvidence:
    """Evidence against the final model, as the search has it or made anew."""
    if not final.effects or final.effects == selection.nominal.fit.effects:
        return selection.nominal
    return selection.final if selection.is_accepted(final) else context.test_model(final)


def _nameable(prepared: PreparedCampaign, library: Sequence[str] | None) -> tuple[str, ...]:
    """Effects that may be named: of the library, those that such shots can test."""
    names = tuple(LIBRARY) if library is None else tuple(library)
    names = tuple(name for name in names if set(LIBRARY[name].columns) <= set(prepared.covariates))
    if prepared.excitation.tests_between_shots:
        return names
    return tuple(name for name in names if LIBRARY[name].kind is not Kind.BETWEEN_SHOTS)
