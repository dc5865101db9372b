"""What a search says at its end: effects accepted, those tied with them, or none.

Lists of candidate fits that are given here are not empty, and the likeliest out of shot is the first.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from impactcell.discrepancy.model import Fit, Problem
from impactcell.discrepancy.search.candidate_fits import is_at_bound
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.evidence import CandidateScan, ModelEvidence
from impactcell.discrepancy.search.indistinguishability import (
    Alternative,
    CandidateFit,
    are_indistinguishable,
    compare_fits,
    widest_rival,
)
from impactcell.discrepancy.search.policy import POLICY


@dataclass(frozen=True, slots=True)
class Outdone:
    """A name that explained most of a gap, and that a free form took away.

    Attributes
    ----------
    effect : str
    form : str
        Identifier of the free form's place.
    same_place : bool
        The form may be the law of the effect: it enters the equations of motion where that does,
        and reads all that it reads.
    """

    effect: str
    form: str
    same_place: bool


@dataclass(frozen=True, slots=True, eq=False)
class SelectionResult:
    """Outcome of the search.

    Attributes
    ----------
    nominal, final : ModelEvidence
        Against the nominal model, and against the model that was accepted or tried last.
    accepted : Fit or None
        None where nothing suffices.
    added : tuple of str
        Effects in the order they were added.
    ties : dict of str to tuple of str
        For each of them those that cannot be told from it.
    p_values : dict of str to float
        Of each of `added`: beside those before it, where that was scanned, else against the nominal model.
    alternatives : tuple of Alternative
        Everything that was fitted, the likeliest first.
    unconverged : tuple of tuple of str
        Sets of effects whose fits came to rest short of an optimum: they neither win nor lose.
    remains : bool
        The model that was accepted leaves something: its effects stand out, but do not suffice.
    outdone : Outdone or None
        What was accepted and fell to a free form.
    """

    nominal: ModelEvidence
    final: ModelEvidence
    accepted: Fit | None
    added: tuple[str, ...]
    ties: dict[str, tuple[str, ...]]
    p_values: dict[str, float]
    alternatives: tuple[Alternative, ...] = field(default=())
    unconverged: tuple[tuple[str, ...], ...] = field(default=())
    remains: bool = False
    outdone: Outdone | None = None

    def is_accepted(self, model: Fit) -> bool:
        """Whether the search ended with this model."""
        return self.accepted is not None and self.accepted.effects == model.effects


def exchanged(selection: SelectionResult) -> list[SelectionResult]:
    """List the outcomes with an effect exchanged for one that is tied with it, each in turn.

    A rival's p-value is that against the nominal model, also where it stands for one that was added later:
    beside those before it was not scanned in every case.
    """
    variants = []
    for effect, rivals in selection.ties.items():
        for rival in rivals:
            added = tuple(rival if name == effect else name for name in selection.added)
            fit = fitted_with(selection, added)
            if fit is None:
                continue
            others = tuple(name for name in (effect, *rivals) if name != rival)
            ties = {rival if name == effect else name: tied for name, tied in selection.ties.items()}
            p_value = selection.nominal.candidate_scan.p_value_of(rival)
            p_values = {**selection.p_values, rival: p_value}
            variants.append(
                replace(selection, accepted=fit, added=added, ties={**ties, rival: others}, p_values=p_values)
            )
    return variants


def tied_models(selection: SelectionResult, established: tuple[str, ...]) -> list[tuple[str, str, Fit]]:
    """List each established effect with a rival that is tied with it, and the model that has the rival."""
    models = []
    for variant in exchanged(selection):
        (effect,) = set(selection.added) - set(variant.added)
        (rival,) = set(variant.added) - set(selection.added)
        if effect in established and variant.accepted is not None:
            models.append((effect, rival, variant.accepted))
    return models


def fitted_with(selection: SelectionResult, added: Iterable[str]) -> Fit | None:
    """Fit that the search made of the nominal model with some effects; None where it made none."""
    wanted = {*selection.nominal.fit.effects, *added}
    fits = (alternative.fit for alternative in selection.alternatives)
    return next((fit for fit in fits if set(fit.effects) == wanted), None)


def reject(
    nominal: ModelEvidence, final: ModelEvidence, alternatives: tuple[Alternative, ...]
) -> SelectionResult:
    """Accept nothing: no effect suffices."""
    return SelectionResult(nominal, final, None, (), {}, {}, alternatives)


def accept_set(
    problem: Problem,
    evidence: tuple[ModelEvidence, ModelEvidence],
    sets: Sequence[CandidateFit],
    order: Sequence[str],
    scans: Sequence[CandidateScan],
    alternatives: tuple[Alternative, ...],
) -> SelectionResult:
    """Accept the likeliest set of effects, each with those that the shots do not tell from it in its place.

    One that leaves the friction factors clearly wider is told from it by these, even where a few shots make
    most of what their likelihoods differ by. A shape that was fitted to the end of its range is no name.

    Parameters
    ----------
    evidence : tuple of ModelEvidence
        Against the nominal model and against the set.
    sets : sequence of CandidateFit
        Of one size.
    order : sequence of str
        Single effects, those fitted inside their range before others, the likeliest first: the one that would
        have come first is the first of the set.
    scans : sequence of CandidateScan
        Of models with some effects: the p-value of an effect is that beside those before it, where that
        was scanned, else that against the nominal model.
    alternatives : tuple of Alternative
        Everything that was fitted, the likeliest first.
    """
    nominal, final = evidence
    best = sets[0].fit
    if is_at_bound(problem.shots, best, nominal.fit.effects):
        return reject(nominal, final, alternatives)
    place = {effect: index for index, effect in enumerate(order)}
    new_effects = best.effects[len(nominal.fit.effects) :]
    added = tuple(sorted(new_effects, key=lambda effect: place.get(effect, len(place))))
    ties: dict[str, tuple[str, ...]] = dict.fromkeys(added, ())
    limit = widest_rival(best.spread, problem.count)
    for rival in (one for one in sets[1:] if one.fit.spread <= limit):
        instead = set(rival.fit.effects) - set(best.effects)
        if len(instead) == 1 and are_indistinguishable(problem, sets[0], rival):
            (replaced,) = set(best.effects) - set(rival.fit.effects)
            ties[replaced] = (*ties[replaced], *instead)
    by_set = {frozenset(scan.fit.effects): scan for scan in scans}
    p_values = {}
    for position, effect in enumerate(added):
        before = frozenset((*nominal.fit.effects, *added[:position]))
        p_values[effect] = by_set.get(before, nominal.candidate_scan).p_value_of(effect)
    return SelectionResult(nominal, final, best, added, ties, p_values, alternatives)


def accept_plausible(
    context: SearchContext,
    nominal: ModelEvidence,
    final: ModelEvidence,
    singles: list[CandidateFit],
    screened: Sequence[Fit],
) -> SelectionResult | None:
    """Accept the effect that explains most of a gap, if the floor itself is only a lower bound.

    What is left then may be noise that nobody stated. It also may be what separates the best effect from its
    rivals: whoever is behind by less than that is tied.
    """
    best = singles[0].fit
    if context.floor_is_certain or is_at_bound(context.problem.shots, best, nominal.fit.effects):
        return None
    shots, coarse = context.problem.shots, context.coarse.shots
    size = shots.values.size
    before = float(nominal.fit.misfit(shots).sum()) - size
    after = float(best.misfit(shots).sum()) - size
    if after > (1.0 - POLICY.min_share_explained) * before:
        return None
    scale = coarse.values.size / size
    smallest = float(best.misfit(shots).sum()) * scale
    tied = tuple(
        model.effects[-1]
        for model in screened
        if model.effects != best.effects
        and float(model.misfit(coarse).sum()) - smallest <= POLICY.max_rival_share * after * scale
    )
    effect = best.effects[-1]
    p_value = nominal.candidate_scan.p_value_of(effect)
    alternatives = compare_fits(singles)
    return SelectionResult(nominal, final, best, (effect,), {effect: tied}, {effect: p_value}, alternatives)
