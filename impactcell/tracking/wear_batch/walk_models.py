"""Does the level walk, or its slope, or has the scatter grown? Banks that say so run beside the tracker's.

Multiple-model estimation (Magill 1965, IEEE Trans. Autom. Control 10:434): each bank gives the density of
every cycle before it is seen. Batch changes and outliers are averaged over in all of them, so that neither
passes for a walk, nor a walk for changes. The log densities over those of the model that is believed are
cumulated from zero up, as in Page's CUSUM of a likelihood ratio (1954, Biometrika 41:100): a walk that begins
or ends, or a scatter that grows, is found, however long there was none before.

Where the scatter grows a change of batch is the first that comes to the tracker's own bank, well before the
scale of the noise has followed. So a change is weighed under both scatters, each with its probability.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.numerics.scatter_correlation import variance_over_scatter
from impactcell.records import Samples
from impactcell.tracking.wear_batch import run_length_bank
from impactcell.tracking.wear_batch.run_length_model import BankModel, Measurement

WALKS = ((0.0, 0.0), (0.03, 0.0), (0.1, 0.0), (0.0, 2e-4), (0.0, 1e-3))
"""Walks that are compared: standard deviations a cycle of level and slope, in those of one estimate. A level
that swings slowly is likelier under a slope that walks."""
GROWN = 2.0
"""Factor by which the scatter may have grown."""
CLEARLY = 6.0
"""Nats by which another walk must have become more likely: of white scatter 3.6 at most in 160 000 cycles, of
batches of 300 cycles 6.9. Where scatter is correlated so many for each of the cycles that count as one: its
variance is known less well, and what it lacks looks like a walk; by 0.7, taken for 0.6, up to 15."""
CERTAINLY = 2.3
"""Nats by which a larger scatter must be more probable to be believed: ten to one."""
TOGETHER = 32
"""Cycles that are taken in at a time, unless an alarm waits for them."""

VARIANCE = Measurement._fields.index("variance")
"""Its column among the cycles that are kept."""


@dataclass(frozen=True, slots=True, eq=False)
class WalkModels:
    """Banks under other walks and a larger scatter, and how much more likely each has become.

    Attributes
    ----------
    variances : ndarray, shape (k, 3)
        Of the walks of level and slope, a cycle; of an estimate, over what it is believed to be. The last is
        the model whose scatter has grown.
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
    walks = [believed, *(other for other in others if other != believed)]
    variances = np.array([*((*walk, 1.0) for walk in walks), (*believed, GROWN**2)])
    count = len(variances)
    return WalkModels(
        variances,
        0,
        (bank,) * count,
        np.tile(np.array(outliers), (count, 1)),
        np.zeros(count),
        np.zeros((0, len(Measurement._fields))),
    )


def append(models: WalkModels, measurement: Measurement) -> WalkModels:
    """Keep a cycle, to be taken in with others."""
    return replace(models, cycles=np.vstack([models.cycles, measurement]))


def take_in(models: WalkModels, model: BankModel, accepted: int, log_odds: float) -> tuple[WalkModels, float]:
    """Take in the cycles that were kept, one at least.

    Parameters
    ----------
    model : BankModel
        What all banks assume beside the walks.
    accepted : int
        See `TrackerState`.
    log_odds : float
        Of a scatter that grows against one that does not, a cycle, before it is seen; nats.

    Returns
    -------
    models : WalkModels
    statistic : float
        Shiryaev-Roberts log statistic of a batch change since, whether or not the scatter has grown.
    """
    # the first row of a series is in the bank already
    series = np.vstack([models.cycles[:1], models.cycles])
    newest = Measurement(*models.cycles[-1].tolist())
    banks, outliers = [], models.outliers.copy()
    log_densities, changed, unchanged = np.zeros((3, len(models.variances)))
    for place, rows in enumerate(models.banks):
        bank = run_length_bank.workspace(rows)
        level, slope, scatter = models.variances[place].tolist()
        walking = model._replace(level_variance=level, slope_variance=slope)
        scattered = series.copy()
        scattered[:, VARIANCE] *= scatter
        count, log_densities[place] = run_length_bank.update_series(
            bank, len(rows), walking, scattered, outliers[place], float(accepted)
        )
        banks.append(run_length_bank.stored(bank, count))
        changed[place], unchanged[place] = run_length_bank.change_weights(
            bank, count, model, newest, float(accepted)
        )
    evidence = np.maximum(models.evidence + log_densities - log_densities[models.believed], 0.0)
    taken = replace(
        models, banks=tuple(banks), outliers=outliers, evidence=evidence, cycles=models.cycles[:0]
    )
    weighed = [models.believed, len(evidence) - 1]
    weights = np.array([0.0, evidence[-1] + log_odds])
    statistic = float(
        np.logaddexp.reduce(changed[weighed] + weights) - np.logaddexp.reduce(unchanged[weighed] + weights)
    ) - math.log(model.hazard)
    return taken, statistic


def believing(models: WalkModels, log_odds: float, correlation: float) -> WalkModels:
    """Believe the model that has become clearly more likely, if one has.

    Parameters
    ----------
    log_odds : float
        See `take_in`.
    correlation : float
        Of the scatter from cycle to cycle: what is taken for less than it is looks like a walk.
    """
    walks = models.variances[:, :-1].any(axis=1)
    bounds = np.where(walks, CLEARLY * variance_over_scatter(correlation), CLEARLY)
    bounds[-1] = CERTAINLY - log_odds
    likeliest = int(np.argmax(models.evidence - bounds))
    if models.evidence[likeliest] <= bounds[likeliest]:
        return models
    variances = models.variances.copy()
    # A scatter that grows does so beside the walk that is believed.
    variances[-1, :-1] = variances[likeliest, :-1]
    return replace(models, variances=variances, believed=likeliest, evidence=np.zeros_like(models.evidence))
