"""Functional forms that come nearest to a spline in one place of a machine's model."""

from collections.abc import Sequence

from impactcell.campaign import Coordinate
from impactcell.discrepancy.laws import RankedForm, Tangent, rank_forms
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.records.travel import may_repeat
from impactcell.discrepancy.machine.regression.block_sums import out_of_fold_losses
from impactcell.discrepancy.machine.regression.trials import ChosenTerm, mean_over_error
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.search.selection import MIN_SHARE_OF_FREE
from impactcell.discrepancy.machine.search.ties import TIE_Z
from impactcell.discrepancy.machine.terms.base_model import LawForm, TermChoice
from impactcell.discrepancy.machine.terms.law_terms import LAW_PREFIX, term_of
from impactcell.discrepancy.machine.terms.rival_forms import COVARIATES, SPLINE_PIECES, columns_of_splines
from impactcell.records import Samples

REFITTED = 20
"""Functional forms that are fitted by themselves, of those that come nearest to the spline."""
PIECES_PER_WAVE = 3.0
"""Pieces of a spline that a wave takes to be seen in it."""


def nearest_forms(
    form: str, tangent: Tangent, tested: tuple[float, float], coordinate: Coordinate
) -> tuple[TermChoice, ...]:
    """Functional forms in a place that come nearest to its spline, over the range that was gone through."""
    of_place = COVARIATES[form] == "position"
    ranked = [
        item
        for item in rank_forms(tangent)
        if _is_resolved(item, tested)
        and not (of_place and any(not may_repeat(period, coordinate, *tested) for period in _periods(item)))
    ]
    return _choices(form, ranked[:REFITTED], max(map(abs, tested)))


def _is_resolved(form: RankedForm, tested: tuple[float, float]) -> bool:
    """Whether a spline could have shown every wave of a form."""
    shortest = PIECES_PER_WAVE * (tested[1] - tested[0]) / SPLINE_PIECES
    return all(period >= shortest for period in _periods(form))


def _periods(form: RankedForm) -> list[float]:
    return [period for item in form.terms for period in item.periods]


def _choices(form: str, ranked: Sequence[RankedForm], reference: float) -> tuple[TermChoice, ...]:
    """Name the forms; of two with one name the first."""
    choices: dict[str, TermChoice] = {}
    for item in ranked:
        choice = TermChoice(LAW_PREFIX + form, law=LawForm(item.terms, reference))
        choices.setdefault(choice.name, choice)
    return tuple(choices.values())


class Forms:
    """Functional forms in one place, fitted by themselves beside a model."""

    def __init__(
        self,
        fits: MachineFits,
        choices: Sequence[TermChoice],
        model: FittedModel,
        forms: Sequence[TermChoice],
    ) -> None:
        self.fits, self.model, self.forms = fits, model, forms
        self.training, _ = fits.blocks(fits.rows_with(choices, columns_of_splines))

    def _fit_columns(self, form: TermChoice) -> list[Column]:
        return [*self.model.fit.columns, *ChosenTerm(form, 0.0).columns]

    def condensed(self, spline: Samples, before: Samples) -> tuple[TermChoice | None, tuple[str, ...]]:
        """Shortest form that does as well out of fold as the spline, and those that do as well as it."""
        gains = {
            form: before - out_of_fold_losses(
                self.training, self._fit_columns(form), self.fits.priors, self.fits.nonnegative
            )
            for form in self.forms
        }  # fmt: skip
        best = max(gains.values(), key=lambda gain: float(gain.sum()))
        if float(best.sum()) < MIN_SHARE_OF_FREE * float(spline.sum()):
            return None, ()
        alike = [
            form
            for form, gain in gains.items()
            if float(gain.sum()) >= MIN_SHARE_OF_FREE * float(best.sum())
            and mean_over_error(best - gain) < TIE_Z
        ]
        shortest = min(alike, key=lambda form: (_numbers(form), -float(gains[form].sum())))
        return shortest, tuple(form.law.name for form in alike if form is not shortest and form.law)


def _numbers(choice: TermChoice) -> int:
    """How many numbers a form has, a wave's period once."""
    if choice.law is None:
        return 0
    shapes = {value for item in choice.law.terms for atom in item.shapes for value in atom}
    return len(term_of(choice).strengths) + len(shapes)
