"""What remains of a machine's records as a function of speed, load or position that nobody had listed.

A smooth spline is fitted in each place, as smooth as blocks that it was not fitted to want it. Of the places
where that helps block after block the one that helps most is condensed: near the spline the squared residuals
are a quadratic function of its coefficients, functional forms are projected on it, and the best are fitted by
themselves. Held-out blocks and the held-out simulation decide; where they do not confirm a place the next is
tried, and the error of the test is shared among all that may be. Where records need no function in one place,
what remains may be a smooth force of velocity and position (`smooth_law.py`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from impactcell.discrepancy.machine.finding import MachineFinding, MachineLaw
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.fits.proof import expected_gap, fall_of_gap, gap
from impactcell.discrepancy.machine.laws.free_splines import (
    FreeSpline,
    best_spline,
    spline_function,
    tangent_of,
    with_spline,
)
from impactcell.discrepancy.machine.laws.law_forms import Forms, nearest_forms
from impactcell.discrepancy.machine.laws.law_proof import proved_form, simulated_without
from impactcell.discrepancy.machine.laws.law_refusal import (
    GIVES_ENERGY,
    NOT_IN_BLOCKS,
    NOTHING_HELPS,
    listed_instead,
    not_in_one_place,
    refusal_of,
)
from impactcell.discrepancy.machine.laws.smooth_law import as_law, smooth_law
from impactcell.discrepancy.machine.records.travel import turns_on
from impactcell.discrepancy.machine.regression.block_sums import Blocks, fit_blocks, out_of_fold_losses
from impactcell.discrepancy.machine.regression.held_number import HeldNumber
from impactcell.discrepancy.machine.regression.trials import mean_over_error
from impactcell.discrepancy.machine.search.held_numbers import NEARLY_ALL, does_as_well, fitted, numbers_held
from impactcell.discrepancy.machine.search.look_alikes import one_way_note
from impactcell.discrepancy.machine.search.needs import MIN_NEED, needs_of_free_forms
from impactcell.discrepancy.machine.search.selection import MIN_GAIN_Z, MIN_SHARE_OF_FREE
from impactcell.discrepancy.machine.search.ties import TIE_Z
from impactcell.discrepancy.machine.simulation.held_out import simulate_held_out
from impactcell.discrepancy.machine.terms.base_model import TermChoice
from impactcell.discrepancy.machine.terms.law_terms import LAW_PREFIX
from impactcell.discrepancy.machine.terms.rival_forms import (
    COVARIATES,
    FREE_FORMS,
    columns_of_splines,
)
from impactcell.discrepancy.search import MAX_EXPECTED_GAP
from impactcell.physics.effect_names import in_words
from impactcell.records import Samples

MIN_SHARE = 0.05
"""Share of the squared residual above the noise that a spline has to close: less is not worth a law [1]."""
MOST_FREED = 3
"""Numbers that the base model holds, and beside which a law is looked for."""
BY_LOAD = TermChoice("load_dependent_friction")
"""Not looked for where it looks like the drive: any law over the load can cancel that then."""


def with_law(fits: MachineFits, finding: MachineFinding) -> MachineFinding:
    """Look for a law where a finding leaves something; the finding with it, or with the reason for none.

    Where a number that the base model holds does as well as any function, a law is looked for beside it.
    """
    if finding.missing_blocks or finding.is_at_floor:
        return finding
    freed: list[HeldNumber] = []
    outcome = _find_law(fits, finding)
    while isinstance(outcome, HeldNumber) and not outcome.is_delay and len(freed) < MOST_FREED:
        freed.append(outcome)
        fits = fits.with_freed(outcome)
        outcome = _find_law(fits, finding)
    listed = listed_instead(fits, finding) if freed and isinstance(outcome, MachineLaw) else ""
    if listed:
        outcome = (
            f"{in_words(listed)} beside {freed[0].phrase} does as well as any law; {freed[0].keys} would tell"
        )
        return replace(finding, law_refused=outcome)
    if isinstance(outcome, MachineLaw):
        notes = (*finding.notes, *(number.beside_a_law for number in freed))
        if "position" in outcome.tested:
            notes = (*notes, *one_way_note(finding.records))
        law = replace(outcome, beside=tuple(number.phrase for number in freed))
        return replace(finding, law=law, notes=notes)
    if isinstance(outcome, HeldNumber):
        outcome = outcome.as_a_law
    return replace(finding, law_refused=freed[0].as_a_law if freed else outcome)


def _find_law(fits: MachineFits, finding: MachineFinding) -> MachineLaw | HeldNumber | str:
    """Find a law beside the final model, whose nuisances are those of `fits`; else what is in its place."""
    own = tuple(term.choice for term in finding.final.terms[len(finding.nominal.terms) :])
    training, held_out = fits.blocks(fits.rows_with(own, columns_of_splines))
    columns = fits.columns(finding.final.terms)
    fit = fit_blocks(training, columns, fits.priors, fits.nonnegative)
    model = replace(finding.final, base=fits.base, fit=fit)
    expected = expected_gap(held_out, model)[1], MAX_EXPECTED_GAP
    if gap(held_out, model) <= expected[0] and gap(training, model) <= expected[1]:
        return NOTHING_HELPS
    before = out_of_fold_losses(training, columns, fits.priors, fits.nonnegative)
    tried = sorted(
        (best_spline(fits, training, model, before, form) for form in _gone_through(fits, finding)),
        key=lambda spline: -float(spline.gains.sum()),
    )
    looked_at = _LookedAt(fits, finding, own, training, held_out, model, before, tuple(tried))
    excess = float(before.sum() - training.noise.sum())
    holding = [spline for spline in tried if _holds(spline.gains, MIN_SHARE * excess)]
    if not holding:
        return looked_at.smooth_law(MIN_SHARE * excess, lambda _: NOTHING_HELPS)
    numbers = looked_at.numbers(NEARLY_ALL * excess)
    as_well = [[one for one, gains in numbers if _stands_for(one, gains, spline.gains)] for spline in holding]
    if as_well[0]:
        return as_well[0][0]
    needs = needs_of_free_forms(fits.smooth_force(own).beside(columns))
    refused, needs_none = "", False
    for spline, instead in zip(holding, as_well, strict=True):
        if instead:
            continue
        if needs[spline.form] < MIN_NEED:
            needs_none = needs_none or not refused
            continue
        law = looked_at.law_in(spline, len(holding))
        fault = refusal_of(finding, law, len(holding))
        if not fault:
            return law
        refused = refused or fault
        if fault == GIVES_ENERGY:  # held-out blocks want it all the same: it stands for something else
            break
    return looked_at.smooth_law(MIN_SHARE * excess, not_in_one_place) if needs_none else refused


def _holds(gains: Samples, least: float) -> bool:
    """Whether a function helps block after block."""
    return mean_over_error(gains) >= MIN_GAIN_Z and float(gains.sum()) >= least


def _stands_for(number: HeldNumber, gains: Samples, of_function: Samples) -> bool:
    """Whether a number does as well as a function, or leaves so little of it that a law begins beside it."""
    nearly_all = float(gains.sum()) >= NEARLY_ALL * float(of_function.sum())
    return does_as_well(gains, of_function, MIN_SHARE_OF_FREE) or (nearly_all and not number.is_delay)


@dataclass(frozen=True, slots=True, eq=False)
class _LookedAt:
    """What a law is looked for in.

    Attributes
    ----------
    own : tuple of TermChoice
        Terms of the model beyond those of the base model.
    training, held_out : Blocks
    model : FittedModel
    before : ndarray, shape (b,)
        Squared residual of each training block out of fold, without any law.
    splines : tuple of FreeSpline
        In all places.
    """

    fits: MachineFits
    finding: MachineFinding
    own: tuple[TermChoice, ...]
    training: Blocks
    held_out: Blocks
    model: FittedModel
    before: Samples
    splines: tuple[FreeSpline, ...]

    def numbers(self, least_of_delay: float) -> list[tuple[HeldNumber, Samples]]:
        """List the numbers that the base model holds and that explain something, and their gains.

        The one that explains most comes first; a delay is none that explains less than `least_of_delay`.
        """
        fits, columns = self.fits, self.model.fit.columns
        found = []
        for number in numbers_held(fits.base, fits.records, fits.scale):
            gains = self.before - out_of_fold_losses(
                self.training, [*columns, *number.columns], fits.priors, fits.nonnegative
            )
            least = least_of_delay if number.is_delay else 0.0
            if float(gains.sum()) < least or mean_over_error(gains) < MIN_GAIN_Z:
                continue
            size = fitted(self.training, columns, number, fits.priors, fits.nonnegative)
            if number.is_possible(size):
                found.append((number, gains))
        return sorted(found, key=lambda one: -float(one[1].sum()))

    def smooth_law(self, least: float, refused: Callable[[str], str]) -> MachineLaw | HeldNumber | str:
        """Smooth force of velocity and position, if records confirm it, or what does as well.

        Else why there is none: `refused` makes it of what is wrong with that force.
        """
        fits, columns = self.fits, list(self.model.fit.columns)
        if turns_on(fits.records, fits.base.coordinate):
            return NOTHING_HELPS
        smooth = smooth_law(fits, self.own, columns, self.before)
        if not _holds(smooth.gains, least):
            return refused(NOT_IN_BLOCKS)
        for number, gains in self.numbers(NEARLY_ALL * float(smooth.gains.sum())):
            if _stands_for(number, gains, smooth.gains):
                return number
        law = as_law(fits, self.finding, self.model, smooth)
        fault = refusal_of(self.finding, law, len(self.splines) + 1)
        return law if not fault else fault if fault == GIVES_ENERGY else refused(fault)

    def law_in(self, spline: FreeSpline, tests: int) -> MachineLaw:
        """Condense a spline to a law, and hold it to what it was not fitted to; one of so many `tests`."""
        fits, finding, model = self.fits, self.finding, self.model
        rivals = tuple(
            LAW_PREFIX + other.form
            for other in self.splines
            if other is not spline and mean_over_error(spline.gains - other.gains) < TIE_Z
        )
        tested = finding.scale.ranges[COVARIATES[spline.form]]
        smooth = with_spline(fits, self.training, model, spline)
        tangent, variance = tangent_of(self.training, fits, smooth, spline, tested)
        choices = nearest_forms(spline.form, tangent, tested, fits.base.coordinate)
        laws = Forms(fits, (*self.own, *choices), model, choices)
        chosen, equivalents = laws.condensed(spline.gains, self.before)
        if chosen is None:
            law_model, fall = smooth, fall_of_gap(self.held_out, model, smooth, finding.seed)
        else:
            law_model, fall = proved_form(fits, model, chosen, finding.seed)
        curve = spline_function(tangent, spline.penalty / variance, tested)
        simulated = None
        if chosen is not None and fall.is_real_among(tests):
            simulated = simulated_without(finding, model), simulate_held_out(finding, law_model)
        return MachineLaw(
            place=LAW_PREFIX + spline.form,
            tested={COVARIATES[spline.form]: tested},
            spline=curve,
            choice=chosen,
            equivalents=equivalents,
            rival_places=rivals,
            without=model,
            model=law_model,
            fall=fall,
            simulated=simulated,
        )


def _gone_through(fits: MachineFits, finding: MachineFinding) -> list[str]:
    """Free forms whose covariate has a range; none over a load that looks like the drive itself.

    And none over the position of what turns on one way: it would be one of the time.
    """
    ranges = finding.scale.ranges
    forms = [form for form in FREE_FORMS if ranges[COVARIATES[form]][1] > ranges[COVARIATES[form]][0]]
    looked_at = {trial.term.choice for step in finding.steps for trial in step.trials}
    is_drive = BY_LOAD in fits.candidates and BY_LOAD not in looked_at
    on = turns_on(fits.records, fits.base.coordinate)
    unfit = {"load"} if is_drive else set[str]()
    unfit |= {"position"} if on else set()
    return [form for form in forms if COVARIATES[form] not in unfit]
