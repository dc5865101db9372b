"""A series of friction estimates, tracked."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from impactcell.cell.series_replay import TrackedSeries, replay, whole_number_fault
from impactcell.errors import SeriesError
from impactcell.numerics.stated_numbers import numbers
from impactcell.records import Samples
from impactcell.tracking.wear_batch import BatchKnowledge, FrictionObservation, TrackerSettings
from impactcell.tracking.wear_batch.input_validation import LARGEST_FRICTION


def track(
    cycle: ArrayLike,
    mu_s: ArrayLike,
    mu_s_std: ArrayLike | None = None,
    *,
    batch: Sequence[object] | None = None,
    limit: float | None = None,
    mu_s_common_std: ArrayLike | None = None,
) -> TrackedSeries:
    """Track wear and batch over a series of friction estimates, and raise what alarms there are.

    Parameters
    ----------
    cycle : array_like, shape (n,)
        Whole numbers from 0 on, in the order in which they were measured; a few may come late, twice, or
        begin anew.
    mu_s, mu_s_std : array_like, shape (n,)
        Estimates and their standard deviations, one number for all or one each; nan, masked, or no standard
        deviations at all, where they are not known.
    batch : sequence of str or None, optional
        Batch of each cycle, where it is known (None, nan, the NA of pandas or empty where not); without it
        changes of batch are found in the series.
    limit : float, optional
        mu_s at which the surface is worn; without it there is no alarm of wear.
    mu_s_common_std : array_like, shape (n,), optional
        Part of the standard deviations that all cycles share (`friction.mu_s.common_std` of an estimate), one
        number for all or one each: `wear.level_common_std` is what of it is in the level, beside
        `wear.level_std`.

    Returns
    -------
    TrackedSeries

    Raises
    ------
    SeriesError
        Series of different lengths, without cycles, or not in order; rows of two cells side by side; what is
        no number; a cycle that is not a whole number from 0 on; batches that are none; a limit that is not
        one number above 0.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.default_rng(1).normal(0.0, 0.002, 400)
    >>> mu_s = 0.2 + 1e-5 * np.arange(400) + 0.02 * (np.arange(400) >= 250) + noise
    >>> series = track(np.arange(400), mu_s, np.full(400, 0.002))
    >>> [(alarm.alarm, alarm.evidence.change_cycle) for alarm in series.alarms]
    [('BatchShift', 250)]
    """
    cycles, values = _numbers("cycle", cycle), _numbers("mu_s", mu_s)
    stds = _each("mu_s_std", mu_s_std, values)
    commons = _each("mu_s_common_std", mu_s_common_std, values)
    if (commons < 0.0).any() or np.isinf(commons).any():
        raise SeriesError("mu_s_common_std is to be 0 or above, and nan where it is not known")
    batches = [None] * len(cycles) if batch is None else _batch_ids(batch)
    sizes = [cycles.shape, values.shape, stds.shape, (len(batches),)]
    if len(set(sizes)) != 1 or cycles.ndim != 1:
        raise SeriesError(f"cycle, mu_s, mu_s_std and batch must be of one length, not of shapes {sizes}")
    if commons.shape != cycles.shape:
        raise SeriesError(f"mu_s_common_std must be as long as cycle, not of shape {commons.shape}")
    for place, number in enumerate(cycles):
        if fault := whole_number_fault(number):
            raise SeriesError(f"cycle[{place}] = {number:g} {fault}")
    worn = math.inf if limit is None else _one_number("limit", limit)
    if not worn > 0.0:
        raise SeriesError(f"limit = {worn:g}: give the mu_s at which the surface is worn, or leave it out")
    if LARGEST_FRICTION < worn < math.inf:
        raise SeriesError(
            f"limit = {worn:g}: no surface reaches it, for a mu_s above {LARGEST_FRICTION:g} is not used; "
            f"give the mu_s at which it is worn, {0.01 * worn:g} if that was meant in %"
        )
    observations = [
        FrictionObservation(int(at), float(value), float(std), batch_id=batch_id, common_std=float(common))
        for at, value, std, batch_id, common in zip(cycles, values, stds, batches, commons, strict=True)
    ]
    knowledge = BatchKnowledge.UNKNOWN if batch is None else BatchKnowledge.KNOWN
    return replay(TrackerSettings(wear_limit=worn, batch=knowledge), observations)


def _numbers(name: str, given: ArrayLike) -> Samples:
    """Give an array of numbers; what a masked one hides is nan."""
    return np.atleast_1d(numbers(name, given, SeriesError))


def _each(name: str, given: ArrayLike | None, values: Samples) -> Samples:
    """Give a number for each of the values, of one for all or of one each; nan without any."""
    each = _numbers(name, math.nan if given is None else given)
    return np.broadcast_to(each, values.shape) if given is None or np.ndim(given) == 0 else each


def _one_number(name: str, given: ArrayLike) -> float:
    numbers = _numbers(name, given)
    if numbers.size != 1:
        raise SeriesError(f"{name} is to be one number, not {numbers.size}")
    return float(numbers.item())


def _batch_ids(given: Sequence[object]) -> list[str | None]:
    try:
        names = list(given)
    except TypeError as error:
        raise SeriesError(
            f"batch = {given!r}: give a batch for each cycle, ['A', 'A', 'B'] say, or leave it out"
        ) from error
    return [_batch_id(place, name) for place, name in enumerate(names)]


def _batch_id(place: int, given: object) -> str | None:
    """Give the name of a batch; None, an empty one, nan and NA, as tables have it, say that there is none."""
    if given is None or given is np.ma.masked:
        return None
    if isinstance(given, str):
        return str(given) or None
    try:
        is_itself = bool(given == given)
    except TypeError:
        return None  # the NA of pandas: whether it is itself it does not say
    except ValueError as error:
        raise SeriesError(f"batch[{place}] is to be the name of one batch, not {given!r}") from error
    return str(given) if is_itself else None
