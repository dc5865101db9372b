"""What is established: terms selected on training blocks, and proved on held-out ones."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import NamedTuple

from impactcell.discrepancy.machine.evidence import FallOfGap
from impactcell.discrepancy.machine.finding import MachineFinding
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.fits.proof import expected_gap, fall_of_gap, gap
from impactcell.discrepancy.machine.fits.remainder import remainder_of
from impactcell.discrepancy.machine.fits.shape_intervals import with_shape_intervals
from impactcell.discrepancy.machine.regression.block_sums import Blocks
from impactcell.discrepancy.machine.regression.record_constants import constants_note
from impactcell.discrepancy.machine.regression.trials import ChosenTerm, TermSearch
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.search.explained_by_numbers import (
    Explained,
    absent_gravity_notes,
    blamed_on_number,
    explained_by,
    explains_most,
    held_number_notes,
)
from impactcell.discrepancy.machine.search.held_numbers import numbers_held, told_from_number
from impactcell.discrepancy.machine.search.look_alikes import (
    alike_note,
    is_over_load,
    like_the_machine,
    machine_parts,
    parts_that_may_be_off,
)
from impactcell.discrepancy.machine.search.pairs import select_pair
from impactcell.discrepancy.machine.search.selection import SelectionStep, select_terms
from impactcell.discrepancy.machine.search.shape_ends import with_ends_named
from impactcell.discrepancy.machine.search.ties import needed_as_much, still_tied
from impactcell.discrepancy.machine.terms.base_model import TermChoice
from impactcell.discrepancy.search import MAX_EXPECTED_GAP

WEIGHINGS = 2
"""Rounds of weights by what a model leaves, and of a model by these weights, at least [1]."""
MOST_WEIGHINGS = 12
"""And at most, as long as shapes move: the farther off, the less weigh the rows that tell them [1]."""
BEFORE_IT = "it was found beside a term that is not confirmed"
"""What a term lacks that was not tried on held-out records."""
SETTLED = 1e-3
"""Relative move of a shape from one round to the next up to which it has settled [1]."""


class _Proof(NamedTuple):
    """Blocks by some weights, models with no, one and two terms, and how the held-out gap falls with each.

    `is_hidden`: a term's own friction hides by these weights that the gap is open without it; `lacks`: what
    the first term that was not confirmed lacks.
    """

    training: Blocks
    held_out: Blocks
    models: list[FittedModel]
    falls: dict[str, FallOfGap]
    is_hidden: bool
    lacks: str = ""


def establish(
    fits: MachineFits,
    notes: list[str],
    seed: int,
    contradicted: frozenset[str] = frozenset(),
    *,
    with_pairs: bool = True,
) -> MachineFinding:
    """Select on training blocks, prove on held-out ones.

    `contradicted` are names of terms that join no model, nor what was found beside them: a simulation errs
    more with them. Two that explain only together what is missing are taken `with_pairs`, if they leave
    nothing.

    The rows are weighed by what the base model leaves of them while terms are looked for; what is found is
    proved once more with weights by its own remainder, so that gaps before and after have the same ones; but
    for a term whose own friction hides by them what it explains (`_prove`).
    """
    base_terms = fits.base_terms
    for turn in range(1, MOST_WEIGHINGS + 1):
        before, base_terms = base_terms, fits.with_best_shapes(base_terms)
        fits.weigh(fits.fit(base_terms, settle=True))
        if turn >= WEIGHINGS and _is_settled(before, base_terms):
            break
    training, held_out = fits.blocks()
    steps: list[SelectionStep] = []
    candidates: list[TermChoice] = []
    told_before, pair = notes, None
    enough = MachineFinding.enough(training, held_out)
    numbers = numbers_held(fits.base, fits.records, fits.scale)
    if enough:
        every = machine_parts(fits.base, is_driven=any(record.force.any() for record in fits.records))
        known = fits.priors, fits.nonnegative
        stated = fits.base.gravity_torque.value
        parts = parts_that_may_be_off(training, fits.columns(base_terms), every, known, stated)
        # Friction over the load is itself a share of the drive, and as absurd where that would be nought.
        candidates = [
            choice
            for choice in fits.candidates
            if not _is_like_the_machine(
                fits, training, choice, (every if is_over_load(choice) else parts).values()
            )
        ]
        notes = [*notes, *alike_note(fits.candidates, candidates, every)]
        search = replace(_search(fits, training, candidates), smooth_force=fits.smooth_force(candidates))
        steps = select_terms(search, fits.columns(base_terms))
        if with_pairs and steps and steps[0].accepted is None:
            pair = select_pair(search, fits.columns(base_terms), steps[0])
            steps = list(pair or steps)
        for number in numbers:
            steps = told_from_number(search, fits.columns(base_terms), steps, number)
        steps = with_ends_named(steps, fits.shapes, fits.base.coordinate)
        notes += [step.note for step in steps if step.note]
    proposed = [step.accepted.term for step in steps if step.accepted is not None]
    proven = [*takewhile(lambda term: term.choice.name not in contradicted, proposed)]
    by_base = proof = _prove(fits, base_terms, proven, seed)
    for turn in range(1, MOST_WEIGHINGS + 1 if proof.falls else 0):
        before = proof.models[-1].terms
        fits.weigh(proof.models[-1])
        still = [term for term in proposed if term.choice.name in proof.falls]
        proof = _prove(fits, base_terms, still, seed, by_base)
        if turn >= WEIGHINGS and _is_settled(before, proof.models[-1].terms):
            break
    models, falls = proof.models, proof.falls
    training, held_out = fits.blocks()
    if pair is not None and (len(falls) < len(pair) or gap(training, models[-1]) > MAX_EXPECTED_GAP):
        return establish(fits, told_before, seed, contradicted, with_pairs=False)
    if falls:
        now = replace(_search(fits, training, candidates), smooth_force=fits.smooth_force(candidates))
        steps = _with_ties_of_now(now, fits.columns(base_terms), steps)
        notes = [*notes, *absent_gravity_notes(steps)]
    nominal, final = models[0], models[-1]
    settled = training, held_out
    without = by_base if proof.is_hidden else proof
    if falls and not fits.base.delay_s.is_held:
        # Blocks are linear in the delay about that of the base model, which took over what the terms explain.
        final = fits.fit(final.terms, settle=True)
        settled = fits.blocks()
    explained: list[Explained] = []
    if enough:
        search = _search(fits, training, ())
        tried = [explained_by(search, fits.columns(final.terms), number) for number in numbers]
        explained = [one for one in tried if one is not None]
        notes = [*notes, *held_number_notes(explained)]
        steps = blamed_on_number(steps, explained)
    most = explains_most(explained)
    unconfirmed = tuple(term.choice.name for term in proposed if term.choice.name not in falls)
    finding = MachineFinding(
        base=fits.base,
        records=fits.records,
        steps=tuple(steps),
        established=tuple(falls),
        unconfirmed=unconfirmed,
        falls=falls,
        nominal=nominal,
        final=with_shape_intervals(fits, final),
        training=training,
        held_out=held_out,
        train_gaps=(gap(without.training, without.models[0]), gap(settled[0], final)),
        expected=expected_gap(settled[1], final),
        fall=fall_of_gap(without.held_out, without.models[0], final, seed, settled[1]),
        held_spans=fits.held_spans(),
        remainder=remainder_of(fits.rows(), final, fits.records),
        block_s=fits.block_s,
        scale=fits.scale,
        notes=tuple(notes),
        seed=seed,
        is_told_of=bool(explained),
        number_off="" if most is None else most.number.name,
        unconfirmed_since=_lacking(unconfirmed, proof.lacks, contradicted),
    )
    if finding.is_at_floor or fits.base.force_offset_by_record:
        return finding
    said = constants_note(finding.remainder.constant_share)
    return replace(finding, notes=(*notes, *said), is_told_of=finding.is_told_of or bool(said))


def _search(fits: MachineFits, training: Blocks, candidates: Sequence[TermChoice]) -> TermSearch:
    return TermSearch(training, candidates, fits.shapes, fits.priors, fits.nonnegative)


def _prove(
    fits: MachineFits,
    base_terms: tuple[ChosenTerm, ...],
    proposed: Sequence[ChosenTerm],
    seed: int,
    by_base: _Proof | None = None,
) -> _Proof:
    """Prove no, one and two of the terms proposed, as far as the held-out gap falls with each.

    A term whose own friction makes rows at rest so doubtful that nothing shows without it either has proved
    itself by the weights of the base model, `by_base`; what is told is each model by its own.
    """
    terms = fits.with_best_shapes((*base_terms, *proposed), len(base_terms))
    training, held_out = fits.blocks()
    models, falls = [fits.fit(base_terms, settle=False)], dict[str, FallOfGap]()
    is_hidden, lacks = False, ""
    for count in range(len(base_terms) + 1, len(terms) + 1):
        after = fits.fit(terms[:count], settle=False)
        fall = fall_of_gap(held_out, models[-1], after, seed)
        if by_base is not None and fall.is_hidden:
            is_hidden = True
            fall = fall_of_gap(by_base.held_out, by_base.models[len(falls)], after, seed, held_out)
        if not fall.is_real:
            lacks = fall.lacks
            break
        models.append(after)
        falls[terms[count - 1].choice.name] = fall
    return _Proof(training, held_out, models, falls, is_hidden, lacks)


def _lacking(names: Sequence[str], lacks: str, contradicted: frozenset[str]) -> dict[str, str]:
    """Say what each of these names lacks: the first what its proof said, others the one before them."""
    by_simulation = "held-out blocks want it, but the simulation of held-out records contradicts it"
    told = [by_simulation if name in contradicted else lacks for name in names[:1]]
    told = [one or BEFORE_IT for one in told] + [BEFORE_IT] * (len(names) - 1)
    return dict(zip(names, told, strict=True))


def _is_settled(before: Sequence[ChosenTerm], now: Sequence[ChosenTerm]) -> bool:
    """Whether the shapes of a model's terms move no more."""
    return len(before) == len(now) and all(
        math.isclose(one.shape, other.shape, rel_tol=SETTLED) for one, other in zip(before, now, strict=True)
    )


def _with_ties_of_now(
    search: TermSearch, columns: list[Column], steps: Sequence[SelectionStep]
) -> list[SelectionStep]:
    """Tell ties by weights of what the terms leave, and no more of what the base model left."""
    told = []
    for step in steps:
        best, tied = step.accepted, step.tied_with
        needed: tuple[str, ...] = ()
        if best is not None:
            numbers = [name for name in tied if name not in search.shapes]
            own = [*columns, *(step.pair.columns if step.pair is not None else ())]
            tied = still_tied(search, own, best, tied) if tied else ()
            needed = tuple(name for name in needed_as_much(search, own, best) if name not in tied)
            tied = (*tied, *needed, *numbers)
        told.append(replace(step, tied_with=tied, needed_as_much=needed))
        columns = [*columns, *(best.term.columns if best is not None else ())]
    return told


def _is_like_the_machine(
    fits: MachineFits, training: Blocks, choice: TermChoice, parts: Iterable[Column]
) -> bool:
    """Whether a candidate at every value of its shape looks like a part of the machine."""
    terms = [ChosenTerm(choice, shape) for shape in fits.shapes[choice.name]]
    return all(like_the_machine(training, term, parts, fits.base) for term in terms)
