"""Fits of one base model to one set of records, by training and held-out blocks."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Self

import numpy as np

from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.model_forces import friction_at_rest
from impactcell.discrepancy.machine.records.motion_scale import motion_scale, widening
from impactcell.discrepancy.machine.records.travel import goes_through_many_turns
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.block_plan import BlockPlan
from impactcell.discrepancy.machine.regression.block_sums import (
    PIECES_PER_BLOCK,
    Blocks,
    LinearFit,
    fit_blocks,
)
from impactcell.discrepancy.machine.regression.direction_doubt import (
    DirectionDoubt,
    floors_left,
    row_weights,
    weighed,
)
from impactcell.discrepancy.machine.regression.held_number import DELAY, HeldNumber
from impactcell.discrepancy.machine.regression.nuisance_priors import nuisance_priors
from impactcell.discrepancy.machine.regression.record_constants import without_constants
from impactcell.discrepancy.machine.regression.smooth_force import SmoothForce, smooth_force_columns
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.regression.weak_form import (
    Column,
    Rows,
    build_rows,
    finer_grid,
    is_of_turns,
    residual_of,
    shape_grid,
)
from impactcell.discrepancy.machine.terms.base_model import PRIOR_REACH, BaseModel, NumberPrior, TermChoice
from impactcell.discrepancy.machine.terms.law_terms import term_of
from impactcell.discrepancy.machine.terms.rival_forms import Freedom
from impactcell.records import Samples

DELAY_STEPS = 9
"""Delays that are tried first, evenly over what the prior allows [1]."""
DELAY_ROUNDS = 2
"""Gauss-Newton steps from the best of them, none further than from one to the next."""
WEIGHINGS = 3
"""Rounds in which a model and the weights of the rows settle [1]."""
REFINEMENTS = 5
"""Rounds in which the grid of a shape is made finer about its best value, a round by a quarter."""
COULOMB: Column = ("coulomb_friction", 0.0, 0)
SPRING: Column = ("restoring_force", 0.0, 0)


class MachineFits:
    """Records of one machine, its base model and what may be named.

    Parameters
    ----------
    records : sequence of UniformRecord
    base : BaseModel
        What the records cannot tell is held in it.
    candidates : sequence of TermChoice
    held : set of int or None
        Places of the records that are held out; None for the last third of each.
    """

    def __init__(
        self,
        records: Sequence[UniformRecord],
        base: BaseModel,
        candidates: Sequence[TermChoice],
        held: set[int] | None,
    ) -> None:
        self.records = tuple(records)
        self.base = base
        self.candidates = tuple(candidates)
        self.held = held
        scale = motion_scale(records, base.response, base.gravity_torque.value)
        many = goes_through_many_turns(base.coordinate, scale.low, scale.high)
        self.scale = replace(scale, many_turns=many)
        self.block_s = base.block_s if math.isfinite(base.block_s) else self.scale.period_s
        self.plan = BlockPlan(self.block_s, held, PIECES_PER_BLOCK / widening(records, self.scale))
        self.gravity = base.gravity_torque.value
        self.delay_s = base.delay_s.value
        self.stiffness = 0.0
        self.priors = nuisance_priors(base, self.gravity)
        self.doubt = DirectionDoubt()
        self._rows = lru_cache(maxsize=4)(self._build)
        self._prepared = lru_cache(maxsize=4)(self.prepared)
        self.grids = {
            choice.name: shape_grid(term_of(choice), self.scale) for choice in (*base.terms, *self.candidates)
        }
        self.shapes = dict(self.grids)

    def with_freed(self, number: HeldNumber) -> Self:
        """Leave free a number that the base model holds."""
        fits = type(self)(self.records, number.freed(self.base), self.candidates, self.held)
        fits.gravity, fits.delay_s, fits.stiffness = self.gravity, self.delay_s, self.stiffness
        fits.doubt = self.doubt
        fits.shapes = dict(self.shapes)
        return fits

    def without_candidates(self, base: BaseModel, records: Sequence[UniformRecord]) -> Self:
        """Fit a base model to records beside nothing but the level of friction, by which rows are weighed."""
        level = [choice for choice in self.candidates if choice.name == COULOMB[0]]
        return type(self)(records, base, level, self.held)

    def _build(self, gravity: float, delay_s: float) -> Rows:
        shapes = self._shapes_of((*self.base.terms, *self.candidates))
        return build_rows(self.records, self.base, shapes, (gravity, delay_s), stiffness=self.stiffness)

    def _shapes_of(self, choices: Iterable[TermChoice]) -> dict[TermChoice, tuple[float, ...]]:
        """Values of the shapes of some terms; a law has none."""
        return {choice: self.shapes.get(choice.name, (0.0,)) for choice in choices}

    def rows(self) -> Rows:
        """Rows at the gravity and delay of now, as they are fitted."""
        return self._prepared(self._rows(self.gravity, self.delay_s), self.doubt)

    def prepared(self, rows: Rows, doubt: DirectionDoubt | None = None) -> Rows:
        """Rows as they are fitted: weighed, and without what each record may have of its own."""
        return self._without_constants(weighed(rows, doubt or self.doubt))

    def _without_constants(self, rows: Rows, weight: Samples | None = None) -> Rows:
        """Rows without a constant of each record, its part that is fitted and its part that is held out."""
        if not self.base.force_offset_by_record:
            return rows
        return without_constants(rows, self.plan.part(rows), weight)

    @property
    def nonnegative(self) -> frozenset[Column]:
        """Strengths that may not give energy."""
        return frozenset(
            column
            for choice in (*self.base.terms, *self.candidates)
            if term_of(choice).nonnegative
            for shape in self.shapes[choice.name]
            for column in ChosenTerm(choice, shape).columns
        )

    def rows_with(self, choices: Sequence[TermChoice], freedom: Freedom) -> Rows:
        """Rows at the same, of other terms beside the base model's, and of other free functions."""
        shapes = self._shapes_of((*self.base.terms, *choices))
        known = self.gravity, self.delay_s
        rows = build_rows(self.records, self.base, shapes, known, freedom, self.stiffness)
        return self.prepared(rows)

    def blocks(self, rows: Rows | None = None) -> tuple[Blocks, Blocks]:
        """Training and held-out blocks of the rows of now, or of others."""
        return self.plan.blocks(rows or self.rows())

    def smooth_force(self, choices: Sequence[TermChoice]) -> SmoothForce:
        """Training rows of the base model's terms and others beside a smooth force."""
        rows = self.rows_with(choices, smooth_force_columns)
        training, _ = self.blocks(rows.only(()))
        chosen = self.plan.rows_of(rows, training)
        return SmoothForce(rows, chosen, training.pieces, self.priors, self.nonnegative)

    @property
    def base_terms(self) -> tuple[ChosenTerm, ...]:
        """Terms of the base model, each at the first value of its shape."""
        return tuple(ChosenTerm(choice, self.shapes[choice.name][0]) for choice in self.base.terms)

    def columns(self, terms: Iterable[ChosenTerm]) -> list[Column]:
        """Columns of a model: its free nuisances and its terms."""
        return [*self.priors, *(column for term in terms for column in term.columns)]

    def fit(self, terms: tuple[ChosenTerm, ...], *, settle: bool) -> FittedModel:
        """Fit a model to the training blocks; with `settle` gravity and delay are found with it."""
        if settle:
            self._settle(terms)
        fit = self._least_squares(terms)
        delay_s = self.base.delay_s.value
        if DELAY in fit.columns:
            delay_s += float(fit.coefficients[fit.columns.index(DELAY)])
        return FittedModel(self.base, terms, fit, delay_s, self.gravity)

    def _least_squares(self, terms: Iterable[ChosenTerm]) -> LinearFit:
        columns = self.columns(terms)
        training, _ = self.blocks(self.rows().only(columns))
        return fit_blocks(training, columns, self.priors, self.nonnegative)

    def _settle(self, terms: tuple[ChosenTerm, ...]) -> None:
        free_gravity = not self.base.gravity_torque.is_held
        for _ in range(2 if free_gravity else 1):
            if not self.base.delay_s.is_held:
                self._settle_delay(terms)
            if free_gravity:
                fit = self._least_squares(terms)
                place = fit.columns.index(("gravity_torque", 0.0, 0))
                self.gravity = self.base.gravity_torque.value + float(fit.coefficients[place])
                self.priors = nuisance_priors(self.base, self.gravity)

    def _settle_delay(self, terms: tuple[ChosenTerm, ...]) -> None:
        """Take the delay of least squares on the training blocks, with its prior."""
        prior = self.base.delay_s
        shapes = {term.choice: (term.shape,) for term in terms}
        columns = [column for column in self.columns(terms) if column != DELAY]

        def loss(delay: float) -> float:
            base = replace(self.base, delay_s=NumberPrior(delay))
            rows = build_rows(self.records, base, shapes, (self.gravity, delay))
            training, _ = self.blocks(self.prepared(rows))
            fit = fit_blocks(training, columns, self.priors, self.nonnegative)
            squares = float(training.losses(fit.columns, fit.coefficients).sum())
            piece = squares / training.pieces
            return squares + piece * ((delay - prior.value) / prior.std) ** 2

        tried = prior.value + prior.std * np.linspace(-PRIOR_REACH, PRIOR_REACH, DELAY_STEPS)
        self.delay_s = min(map(float, tried), key=loss)
        apart = float(tried[1] - tried[0])
        for _ in range(DELAY_ROUNDS):
            rows = build_rows(self.records, self.base, shapes, (self.gravity, self.delay_s))
            training, _ = self.blocks(self.prepared(rows))
            fit = fit_blocks(training, [*columns, DELAY], self.priors, self.nonnegative)
            nearer = prior.value + float(fit.coefficients[-1])
            self.delay_s = float(np.clip(nearer, self.delay_s - apart, self.delay_s + apart))

    def weigh(self, model: FittedModel) -> None:
        """Weigh rows by how surely they know the direction of friction, by what a model leaves.

        Where the delay is free, by what it leaves at its own; the delay that blocks are built at stays.
        """
        if model.value(SPRING) != self.stiffness:
            self.stiffness = model.value(SPRING)
            self._rows.cache_clear()
        built_at = self.gravity, self.delay_s
        if not self.base.delay_s.is_held:
            self._settle(model.terms)
        own = [term for term in model.terms if not term_of(term.choice).is_friction]
        of_level, columns = [*self.columns(own), COULOMB], self.columns(model.terms)
        for _ in range(WEIGHINGS):
            training, _ = self.blocks(self.rows().only({*of_level, *columns}))
            level = fit_blocks(training, of_level, self.priors, self.nonnegative)
            fit = fit_blocks(training, columns, self.priors, self.nonnegative)
            rows = self._rows(self.gravity, self.delay_s)
            rows = self._without_constants(rows, row_weights(rows, self.doubt))
            residual = residual_of(rows, fit.columns, fit.coefficients)
            at_rest = friction_at_rest(replace(model, fit=fit), self.records, self.scale)
            friction = max(float(level.coefficients[-1]), at_rest)
            chosen = self.plan.rows_of(rows, training)
            self.doubt = DirectionDoubt(friction, floors_left(rows, residual, chosen, friction))
        self.gravity, self.delay_s = built_at
        self.priors = nuisance_priors(self.base, self.gravity)

    def with_best_shapes(self, terms: tuple[ChosenTerm, ...], first: int = 0) -> tuple[ChosenTerm, ...]:
        """Give each term from the `first` on the shape of least squares, on its grid and between.

        One after the other, and from the whole grid whatever was found before: beside other terms and other
        weights of the rows it is another one.
        """
        for place in range(first, len(terms)):
            choice = terms[place].choice
            finer = grid = self.grids[choice.name]
            if len(grid) == 1:
                continue
            shape = self._best_shape(terms, place, grid)
            for _ in range(0 if is_of_turns(term_of(choice), self.scale) else REFINEMENTS):
                finer = finer_grid(finer, shape)
                shape = self._best_shape(terms, place, finer)
            self.shapes[choice.name] = tuple(sorted({*grid, shape}))
            self._rows.cache_clear()
            terms = (*terms[:place], ChosenTerm(choice, shape), *terms[place + 1 :])
        return terms

    def _best_shape(self, terms: tuple[ChosenTerm, ...], place: int, grid: Sequence[float]) -> float:
        """Value of the shape of one of the terms that leaves least of the training blocks."""
        shapes = {term.choice: (term.shape,) for term in terms} | {terms[place].choice: tuple(grid)}
        rows = build_rows(self.records, self.base, shapes, (self.gravity, self.delay_s))
        training, _ = self.blocks(self.prepared(rows))

        def loss(shape: float) -> float:
            other = (*terms[:place], ChosenTerm(terms[place].choice, shape), *terms[place + 1 :])
            fit = fit_blocks(training, self.columns(other), self.priors, self.nonnegative)
            return float(training.losses(fit.columns, fit.coefficients).sum())

        return min(grid, key=loss)

    def held_spans(self) -> tuple[tuple[int, float, float], ...]:
        """Record, begin and end of each stretch of held-out blocks between the gaps of records."""
        return self.plan.held_spans(self.rows(), self.records)
