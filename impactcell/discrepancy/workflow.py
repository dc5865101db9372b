"""The whole workflow, one step a line: fit, locate, name, extend, prove, next experiment."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.data import noise_floor
from impactcell.discrepancy.data.prepared_campaign import Material, laid_out, prepare, split
from impactcell.discrepancy.data.shots import Index, thinned
from impactcell.discrepancy.model.block_selection import decided, followed
from impactcell.discrepancy.model.fit import Fit, refit_own
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.model.intervals import Estimate, estimates
from impactcell.discrepancy.model.linearisation import linearise
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.search.candidate_fits import Mapper, Setup
from impactcell.discrepancy.search.experiment_design import Proposal, propose
from impactcell.discrepancy.search.model_selection import Search, search
from impactcell.discrepancy.search.unexplained_gap import Unexplained, describe
from impactcell.discrepancy.search.validation import Proof, prove
from impactcell.physics import Kind, Plant
from impactcell.physics.effects import LIBRARY

NO_GAP, NAMED, TIED, UNKNOWN = "no_gap", "named", "tied", "unknown"
COARSE = 400
"""Samples of a channel and shot that a search among many models reads."""


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
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
    material: Material
    floor: noise_floor.Floor
    replicates: noise_floor.Replicates
    training: Index
    held_out: Index
    problem: Problem
    held_problem: Problem
    nominal: Fit
    final: Fit
    held_nominal: Fit
    held_final: Fit
    search: Search
    parameters: tuple[Estimate, ...]
    proof: Proof
    unexplained: Unexplained | None
    proposals: tuple[Proposal, ...]
    seed: int

    @property
    def added(self) -> tuple[str, ...]:
        """Effects that joined the nominal model."""
        return self.search.added


def investigate(
    campaign: Campaign,
    *,
    seed: int = 0,
    mapper: Mapper | None = None,
    plant: Plant | None = None,
    library: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Findings:
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
    say = progress or (lambda _step: None)
    each: Mapper = mapper or (lambda function, items: [function(item) for item in items])
    names = tuple(LIBRARY) if library is None else tuple(library)
    if campaign.excitation is Excitation.DRIVEN:
        # Blocks of one record share what acts between records; there are too few of those for any test.
        names = tuple(name for name in names if LIBRARY[name].kind is not Kind.BETWEEN_SHOTS)
    material = prepare(campaign)
    floor = noise_floor.sensors(material)
    training, held_out = split(material, seed)
    problem = Problem(laid_out(material, training, floor.noise_std), len(material.batches))
    say("fitting the nominal model")
    nominal = fit_nominal(problem, plant)
    if campaign.excitation is Excitation.DRIVEN:
        kept = followed(problem, nominal)
        if len(kept) < len(training):
            note = (
                f"{len(training) - len(kept)} of {len(training)} training blocks were left out: in them "
                "stick ends, or does not, by so little that noise decides, or the nominal model does not "
                "follow them."
            )
            material = replace(material, notes=(*material.notes, note))
            training = training[kept]
            problem = Problem(laid_out(material, training, floor.noise_std), len(material.batches))
            nominal = fit_nominal(problem, plant)
    say("locating the gap and naming effects")
    fewer = thinned(problem.shots, COARSE)
    coarse = problem if fewer is problem.shots else Problem(fewer, len(material.batches))
    found = search(Setup(problem, coarse, material, names, seed, each, _certain(material, floor)), nominal)
    final = found.accepted or nominal
    say("proving on held-out shots")
    held_problem = Problem(laid_out(material, held_out, floor.noise_std), len(material.batches))
    if campaign.excitation is Excitation.DRIVEN:
        held_out = held_out[decided(held_problem, refit_own(held_problem, final))]
        held_problem = Problem(laid_out(material, held_out, floor.noise_std), len(material.batches))
    proof, replicates, held_nominal, held_final = _prove(
        material, floor, (problem, held_problem), nominal, final, (training, held_out), seed
    )
    tangent = linearise(problem, final)
    verdict = _verdict(found)
    say("planning the next experiment")
    return Findings(
        verdict=verdict,
        material=material,
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
        search=found,
        parameters=estimates(final, tangent),
        proof=proof,
        unexplained=describe(problem, found.nominal) if verdict == UNKNOWN else None,
        proposals=propose(problem, final, _rivals(found)),
        seed=seed,
    )


def _certain(material: Material, floor: noise_floor.Floor) -> bool:
    """Whether what is above the floor is a gap: noise is stated, or sampled fast enough to be seen."""
    return "stated" in floor.source or material.excitation is Excitation.TAP


def _verdict(found: Search) -> str:
    if found.accepted is None:
        return UNKNOWN
    if not found.added:
        return NO_GAP
    return TIED if any(found.ties.values()) else NAMED


def _prove(
    material: Material,
    floor: noise_floor.Floor,
    problems: tuple[Problem, Problem],
    nominal: Fit,
    final: Fit,
    places: tuple[Index, Index],
    seed: int,
) -> tuple[Proof, noise_floor.Replicates, Fit, Fit]:
    problem, held_problem = problems
    held = refit_own(held_problem, final)
    log_factor = np.empty(len(material.shots))
    log_factor[places[0]] = final.local.log_factor
    log_factor[places[1]] = held.local.log_factor
    replicates = noise_floor.replicate_spread(material.shots, log_factor, len(material.batches))
    proof, old, new = prove(problem, nominal, final, held_problem, floor, replicates, seed)
    return proof, replicates, old, new


def _rivals(found: Search) -> list[tuple[str, str, Fit]]:
    made = []
    for effect, rivals in found.ties.items():
        for rival in rivals:
            wanted = {rival if one == effect else one for one in found.added}
            for alternative in found.alternatives:
                if set(alternative.effects) >= wanted and len(alternative.effects) == len(
                    found.accepted.effects if found.accepted else ()
                ):
                    made.append((effect, rival, alternative.fit))
                    break
    return made


def plant_of(findings: Findings) -> Plant:
    """Plant of the final model."""
    values = {("", one.parameter): one.value for one in findings.parameters if not one.effect}
    effects: dict[str, dict[str, float | Sequence[float]]] = {}
    for one in findings.parameters:
        if not one.effect:
            continue
        mine = effects.setdefault(one.effect, {})
        if one.batch:
            mine[one.parameter] = (*_several(mine.get(one.parameter)), one.value)
        else:
            mine[one.parameter] = one.value
    mu_k = values["", "mu_k"]
    ratio = values.get(("", "ratio"), 1.0)
    return Plant(
        stiffness_n_per_m=values.get(("", "stiffness_n_per_m"), 6e5),
        damping_n_s_per_m=values.get(("", "damping_n_s_per_m"), 0.0),
        mu_s=mu_k * ratio,
        mu_k=mu_k,
        gravity_m_s2=findings.material.gravity_m_s2,
        effects=effects,
    )


def _several(value: float | Sequence[float] | None) -> Sequence[float]:
    return value if isinstance(value, Sequence) else ()
