"""A series of friction estimates, tracked."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from impactcell.cell.series_replay import TrackedSeries, replay
from impactcell.errors import SeriesError
from impactcell.tracking.wear_batch import BatchKnowledge, FrictionObservation, TrackerSettings


def track(
    cycle: ArrayLike,
    mu_s: ArrayLike,
    mu_s_std: ArrayLike | None = None,
    *,
    batch: Sequence[str | None] | None = None,
    limit: float = math.inf,
) -> TrackedSeries:
    """Track wear and batch over a series of friction estimates, and raise what alarms there are.

    Parameters
    ----------
    cycle : array_like, shape (n,)
        Whole numbers from 0 on, ascending.
    mu_s, mu_s_std : array_like, shape (n,)
        Estimates and their standard deviations; nan, or no standard deviations at all, where they are not
        known.
    batch : sequence of str or None, optional
        Batch of each cycle, where it is known; without it changes of batch are found in the series.
    limit : float
        mu_s at which the surface is worn.

    Returns
    -------
    TrackedSeries

    Raises
    ------
    SeriesError
        Series of different lengths, or without cycles; a cycle that is not a whole number from 0 on.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.default_rng(1).normal(0.0, 0.002, 400)
    >>> mu_s = 0.2 + 1e-5 * np.arange(400) + 0.02 * (np.arange(400) >= 250) + noise
    >>> series = track(np.arange(400), mu_s, np.full(400, 0.002))
    >>> [(alarm.alarm, alarm.evidence.change_cycle) for alarm in series.alarms]
    [('BatchShift', 250)]
    """
    cycles, values = np.atleast_1d(np.asarray(cycle, np.float64)), np.atleast_1d(np.asarray(mu_s, np.float64))
    stds = np.full(values.shape, math.nan) if mu_s_std is None else np.asarray(mu_s_std, np.float64)
    sizes = [cycles.shape, values.shape, stds.shape, cycles.shape if batch is None else (len(batch),)]
    if len(set(sizes)) != 1 or cycles.ndim != 1:
        raise SeriesError(f"cycle, mu_s, mu_s_std and batch must be of one length, not of shapes {sizes}")
    wrong = np.flatnonzero(~((cycles >= 0.0) & (cycles == np.floor(cycles)) & np.isfinite(cycles)))
    if wrong.size:
        raise SeriesError(f"cycle[{wrong[0]}] = {cycles[wrong[0]]:g} is not a whole number from 0 on")
    observations = [
        FrictionObservation(int(at), float(value), float(std), batch_id=batch_id)
        for at, value, std, batch_id in zip(
            cycles, values, stds, [None] * len(cycles) if batch is None else batch, strict=True
        )
    ]
    knowledge = BatchKnowledge.UNKNOWN if batch is None else BatchKnowledge.KNOWN
    return replay(TrackerSettings(wear_limit=limit, batch=knowledge), observations)
