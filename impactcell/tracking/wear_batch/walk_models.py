"""Does the level walk, or its slope? Banks under several random walks run beside it; the likelier is taken.

Multiple-model estimation (Magill 1965, IEEE Trans. Autom. Control 10:434): each bank gives the density of
every cycle before it is seen. Batch changes and outliers are averaged over in all of them, so that neither
passes for a walk, nor a walk for changes. The log densities over those of the walk that is believed are
cumulated from zero up, as in Page's CUSUM of a likelihood ratio (1954, Biometrika 41:100): a walk that begins
or ends is found, however long there was none before.
"""

from dataclasses import dataclass, replace

import numpy as np

from impactcell.records import Samples
from impactcell.tracking.wear_batch import run_length_bank
from impactcell.tracking.wear_batch.run_length_model import BankModel, Measurement

WALKS = ((0.0, 0.0), (0.03, 0.0), (0.1, 0.0), (0.0, 2e-4), (0.0, 1e-3))
"""Walks that are compared: standard deviations a cycle of level and slope, in those of one estimate. A level
that swings slowly is likelier under a slope that walks."""
CLEARLY = 6.0
"""Nats by which another walk must have become more likely: of white scatter 3.6 at most in 160 000 cycles, of
batches of 300 cycles 6.9."""
TOGETHER = 32
"""Cycles that are taken in at a time: no alarm waits for them."""


@dataclass(frozen=True, slots=True, eq=False)
class WalkModels:
    """Banks under other walks, and how much more likely each has become.

    Attributes
    ----------
    variances : ndarray, shape (k, 2)
        Of the walks of level and slope, a cycle.
    believed : int
        Place of the one that the tracker believes.
    banks : tuple of ndarray, shapes (n, 22)
    outliers : ndarray, shape (k, 2)
        See `TrackerState`.
    evidence : ndarray, shape (k,)
        Log likelihood over that of the believed one, cumulated from zero up; nats.
    cycles : ndarray, shape (m, 6)
        Cycles that are not taken in yet, columns as the fields of `Measurement`.
    """

    variances: Samples
    believed: int
    banks: tuple[Samples, ...]
    outliers: Samples
    evidence: Samples
    cycles: Samples


def begin(
    bank: Samples, outliers: tuple[float, float], believed: tuple[float, float], unit: float
) -> WalkModels:
    """Begin from the tracker's bank, and the variances that it believes.

    Parameters
    ----------
    unit : float
        Variance of one estimate.
    """
    others = [(level**2 * unit, slope**2 * unit) for level, slope in WALKS]
    variances = np.array([believed, *(other for other in others if other != believed)])
    count = len(variances)
    return WalkModels(
        variances,
        0,
        (bank,) * count,
        np.tile(np.array(outliers), (count, 1)),
        np.zeros(count),
        np.zeros((0, len(Measurement._fields))),
    )


def update(models: WalkModels, measurement: Measurement, model: BankModel, accepted: int) -> WalkModels:
    """Take a cycle in; another walk is `believed` from it on where that has become clearly more likely.

    Parameters
    ----------
    model : BankModel
        What all banks assume beside the walks.
    accepted : int
        See `TrackerState`.
    """
    cycles = np.vstack([models.cycles, measurement])
    if len(cycles) < TOGETHER:
        return replace(models, cycles=cycles)
    # the first row of a series is in the bank already
    series = np.vstack([cycles[:1], cycles])
    banks, outliers, log_densities = [], models.outliers.copy(), np.zeros(len(models.variances))
    for place, (rows, (level, slope)) in enumerate(zip(models.banks, models.variances.tolist(), strict=True)):
        bank = run_length_bank.workspace(rows)
        walking = model._replace(level_variance=level, slope_variance=slope)
        count, log_densities[place] = run_length_bank.update_series(
            bank, len(rows), walking, series, outliers[place], float(accepted)
        )
        banks.append(run_length_bank.stored(bank, count))
    evidence = np.maximum(models.evidence + log_densities - log_densities[models.believed], 0.0)
    likeliest = int(np.argmax(evidence))
    has_changed = evidence[likeliest] > CLEARLY
    return WalkModels(
        models.variances,
        likeliest if has_changed else models.believed,
        tuple(banks),
        outliers,
        np.zeros_like(evidence) if has_changed else evidence,
        cycles[:0],
    )
