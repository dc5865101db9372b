"""Terms tried beside a model, by blocks that it was not fitted to."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.machine.regression.block_sums import Blocks, out_of_fold_losses, roughness_penalty
from impactcell.discrepancy.machine.regression.smooth_force import SmoothForce
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.terms.base_model import NumberPrior, TermChoice
from impactcell.discrepancy.machine.terms.law_terms import term_of
from impactcell.discrepancy.machine.terms.rival_forms import KNOTS
from impactcell.records import Samples

STRAIGHT = 1e-4
"""Weight of a free form's bends, over the information that blocks have of a corner: where no block has been
it decides, and nowhere else [1]."""


@dataclass(frozen=True, slots=True)
class ChosenTerm:
    """A term at a value of its shape."""

    choice: TermChoice
    shape: float

    @property
    def columns(self) -> tuple[Column, ...]:
        """Its columns of the regression."""
        strengths = term_of(self.choice).strengths
        return tuple((self.choice.name, self.shape, number) for number in range(len(strengths)))


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One candidate beside a model.

    Attributes
    ----------
    term : ChosenTerm
    gains : ndarray, shape (b,)
        Fall of each block's squared residual out of fold.
    shares : ndarray, shape (b,)
        The same over that residual, between -1 and 1: where a motion dies away its first blocks gain most,
        and the later ones tell as surely.
    at_end : bool
        Its shape came to the end of its grid.
    """

    term: ChosenTerm
    gains: Samples
    shares: Samples
    at_end: bool

    @property
    def gain(self) -> float:
        """Fall of the squared residual over all blocks."""
        return float(self.gains.sum())

    @property
    def z(self) -> float:
        """Mean gain over its standard error, or mean share of a gain over its own, whichever is larger."""
        return max(mean_over_error(self.gains), mean_over_error(self.shares))


@dataclass(frozen=True, slots=True, eq=False)
class TermSearch:
    """What a selection works with.

    Attributes
    ----------
    blocks : Blocks
        Of the training records.
    candidates : sequence of TermChoice
    shapes : mapping
        Grid of each candidate by its name.
    priors : mapping
    nonnegative : frozenset of Column
    smooth_force : SmoothForce, optional
        Rows of these blocks beside a force of which nobody knows the form; without it any is named that
        stands out.
    """

    blocks: Blocks
    candidates: Sequence[TermChoice]
    shapes: Mapping[str, tuple[float, ...]]
    priors: Mapping[Column, NumberPrior]
    nonnegative: frozenset[Column]
    smooth_force: SmoothForce | None = None

    def losses(self, columns: Sequence[Column]) -> Samples:
        """Out-of-fold squared residual of every block, shape (b,)."""
        return out_of_fold_losses(self.blocks, columns, self.priors, self.nonnegative)

    def free_losses(self, columns: Sequence[Column], form: str) -> Samples:
        """Losses of a model with a free form beside its terms, shape (b,).

        Its corners bend as little as blocks want it: where no other record has been, it goes on straight.
        """
        corners = [(form, 0.0, number) for number in range(KNOTS)]
        every = [*columns, *corners]
        penalty = np.zeros((len(every), len(every)))
        penalty[-KNOTS:, -KNOTS:] = roughness_penalty(self.blocks, corners, STRAIGHT)
        return out_of_fold_losses(self.blocks, every, self.priors, self.nonnegative, penalty)

    def gap(self, columns: Sequence[Column]) -> float:
        """Gap of a model out of fold [1 = noise floor]."""
        return self.gap_of(self.losses(columns))

    def gap_of(self, losses: Samples) -> float:
        """Gap of what is left of the blocks [1 = noise floor]."""
        return math.sqrt(float(losses.sum()) / max(float(self.blocks.noise.sum()), 1e-300))

    def shares(self, gains: Samples, before: Samples) -> Samples:
        """Gains over what each block had left, no less than the sensors' noise; shape (b,)."""
        left = np.maximum(np.maximum(before, self.blocks.noise), np.finfo(float).tiny)
        return np.clip(gains / left, -1.0, 1.0)

    def best_shape(self, choice: TermChoice, columns: Sequence[Column], before: Samples) -> Trial:
        """Try a candidate at every value of its shape."""
        trials = [
            self.trial(ChosenTerm(choice, shape), columns, before) for shape in self.shapes[choice.name]
        ]
        return max(trials, key=lambda trial: trial.gain)

    def trial(self, term: ChosenTerm, columns: Sequence[Column], before: Samples) -> Trial:
        """Try a candidate at one value of its shape."""
        grid = self.shapes[term.choice.name]
        gains = before - self.losses([*columns, *term.columns])
        at_end = len(grid) > 1 and term.shape in (grid[0], grid[-1])
        return Trial(term, gains, self.shares(gains, before), at_end)


def mean_over_error(values: Samples) -> float:
    """Mean over its standard error; inf where nothing scatters, 0 where there is nothing."""
    error = float(values.std(ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else math.inf
    mean = float(values.mean())
    return mean / error if error > 0.0 else math.inf * mean if mean else 0.0
