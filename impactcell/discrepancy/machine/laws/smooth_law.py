"""A smooth force of velocity and position that remains, where no function in one place will do.

Waves whose sizes go by one level and one correlation length, as blocks that they were not fitted to want
them. It is known as a map, with its band, and has no form.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.laws import BAND, DRAWN, FittedFunction
from impactcell.discrepancy.machine.finding import MachineFinding, MachineLaw
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.fits.proof import fall_of_gap
from impactcell.discrepancy.machine.laws.free_splines import information_of
from impactcell.discrepancy.machine.laws.law_proof import simulated_without
from impactcell.discrepancy.machine.regression.block_sums import Blocks, fit_blocks, out_of_fold_losses
from impactcell.discrepancy.machine.regression.smooth_force import reach_of
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.simulation.held_out import simulate_held_out
from impactcell.discrepancy.machine.terms.base_model import NumberPrior, Reach, TermChoice
from impactcell.discrepancy.machine.terms.law_terms import SMOOTH_LAW
from impactcell.discrepancy.machine.terms.smooth_waves import spectrum, waves_at
from impactcell.records import Samples

LENGTHS = (0.2, 0.4, 0.8, 1.6)
"""Correlation lengths that are tried, over half the range that was gone through [1]."""
LEVELS = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Its standard deviations that are tried, over that of what remains [1]."""
PLACES = 21
"""Places, evenly over the range of positions, at which the force is told over the velocity [1]."""

Priors = Mapping[Column, NumberPrior]


@dataclass(frozen=True, slots=True, eq=False)
class SmoothLaw:
    """A smooth force beside a model.

    Attributes
    ----------
    reach : Reach
    training, held_out : Blocks
        With its columns.
    priors : mapping
        Of nuisances and of its waves.
    gains : ndarray, shape (b,)
        Fall of each training block's squared residual out of fold.
    """

    reach: Reach
    training: Blocks
    held_out: Blocks
    priors: Priors
    gains: Samples

    @property
    def term(self) -> ChosenTerm:
        """The force as a term of a model."""
        return _term(self.reach)


def _term(reach: Reach) -> ChosenTerm:
    return ChosenTerm(TermChoice(SMOOTH_LAW, reach=reach), 0.0)


def smooth_law(
    fits: MachineFits, own: tuple[TermChoice, ...], columns: list[Column], before: Samples
) -> SmoothLaw:
    """Smooth force beside a model as blocks that it was not fitted to want it.

    Parameters
    ----------
    own : tuple of TermChoice
        Terms of the model beyond those of the base model.
    columns : list of Column
        Of the model.
    before : ndarray, shape (b,)
        Squared residual of each training block out of fold, without the force.
    """
    reach = reach_of(fits.scale.ranges)
    term = _term(reach)
    waves = term.columns
    training, held_out = fits.blocks(fits.rows_with((*own, term.choice), lambda *_: {}))
    squares = np.diag(training.products.sum(axis=0))[training.places(waves)]
    trials = []
    for length, level in itertools.product(LENGTHS, LEVELS):
        variances = spectrum(length)
        unit = math.sqrt(float(before.sum()) / max(float(squares @ variances), np.finfo(float).tiny))
        stds = level * unit * np.sqrt(variances)
        priors = {
            **fits.priors,
            **{wave: NumberPrior(0.0, std) for wave, std in zip(waves, stds, strict=True)},
        }
        losses = out_of_fold_losses(training, [*columns, *waves], priors, fits.nonnegative)
        trials.append(SmoothLaw(reach, training, held_out, priors, before - losses))
    return max(trials, key=lambda trial: float(trial.gains.sum()))


def as_law(fits: MachineFits, finding: MachineFinding, model: FittedModel, smooth: SmoothLaw) -> MachineLaw:
    """Fit a smooth force beside a model, and hold it to what it was not fitted to."""
    columns = [*model.fit.columns, *smooth.term.columns]
    fit = fit_blocks(smooth.training, columns, smooth.priors, fits.nonnegative)
    with_it = replace(model, terms=(*model.terms, smooth.term), fit=fit)
    reach, slices = smooth.reach, _slices(smooth, with_it)
    return MachineLaw(
        place=SMOOTH_LAW,
        tested={"velocity": (-reach.speed, reach.speed), "position": reach.position},
        spline=slices[len(slices) // 2][1],
        choice=None,
        equivalents=(),
        rival_places=(),
        without=model,
        model=with_it,
        fall=fall_of_gap(smooth.held_out, model, with_it, finding.seed),
        simulated=(simulated_without(finding, model), simulate_held_out(finding, with_it)),
        slices=slices,
    )


def _slices(smooth: SmoothLaw, model: FittedModel) -> tuple[tuple[float, FittedFunction], ...]:
    """Force over the velocity from place to place, with the 95 % band of it less its mean over all.

    The mean is what a constant force of the machine takes up.
    """
    waves, reach = smooth.term.columns, smooth.reach
    information, _, _ = information_of(smooth.training, model, waves, smooth.priors)
    stds = np.array([smooth.priors[wave].std for wave in waves])
    covariance = np.outer(stds, stds) * np.linalg.inv(np.outer(stds, stds) * information + np.eye(len(stds)))
    velocity = np.linspace(-reach.speed, reach.speed, DRAWN)
    places = np.linspace(*reach.position, PLACES)
    basis = np.stack([waves_at(np.full(DRAWN, place), velocity, reach).T for place in places])
    moving = basis - basis.mean(axis=(0, 1))
    value = basis @ np.array([model.value(wave) for wave in waves])
    std = np.sqrt(np.maximum(np.einsum("snk,kl,snl->sn", moving, covariance, moving), 0.0))
    return tuple(
        (float(place), FittedFunction(velocity, middle, middle - BAND * half, middle + BAND * half))
        for place, middle, half in zip(places, value, std, strict=True)
    )
