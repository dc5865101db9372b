"""What a model leaves of a machine's records: for how long it stays alike, and in which records it is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.weak_form import Rows, residual_of
from impactcell.records import Samples

MOST = 0.5
"""Share of what is left that counts as most of it."""
FEW_RECORDS = 1.0 / 3.0
"""Share of the records up to which those that hold most of it are told: all alike, half of them do [1]."""


@dataclass(frozen=True, slots=True, eq=False)
class Remainder:
    """Residuals of the equation of motion, in squares above the sensors' noise.

    Attributes
    ----------
    correlation_s : float
        Time over which they stay alike.
    shots : tuple of int
        The few records in which most of them is, the worst first; none where it is spread.
    share : float
        How much of them is in these.
    constant_share : float
        How much a constant force of each record's own would take.
    """

    correlation_s: float
    shots: tuple[int, ...]
    share: float
    constant_share: float


def remainder_of(rows: Rows, model: FittedModel, records: Sequence[UniformRecord]) -> Remainder:
    """Look at what a model leaves, record by record, held-out ones included."""
    residual = residual_of(rows, model.fit.columns, model.fit.coefficients)
    inside = [np.flatnonzero(rows.record == place) for place in range(len(records))]
    left = np.array(
        [max(float(np.sum(residual[rows_of] ** 2 - rows.variance[rows_of])), 0.0) for rows_of in inside]
    )
    whole = float(left.sum())
    constants = sum(float(residual[rows_of].sum()) ** 2 / max(len(rows_of), 1) for rows_of in inside)
    worst = np.argsort(-left, kind="stable")
    count = int(np.searchsorted(np.cumsum(left[worst]), MOST * whole)) + 1
    few = worst[:count] if count <= FEW_RECORDS * len(records) else worst[:0]
    return Remainder(
        _correlation_time(rows, residual, inside),
        tuple(records[place].shot for place in few),
        float(left[few].sum()) / whole if whole else 0.0,
        min(constants, whole) / whole if whole else 0.0,
    )


def _correlation_time(rows: Rows, residual: Samples, inside: Sequence[np.ndarray]) -> float:
    """Sum of the correlations to the first below 0, mean over records."""
    total, steps = 0.0, []
    for rows_of in inside:
        part, time = residual[rows_of], rows.time_s[rows_of]
        if len(part) < 4 or not part.any():
            continue
        steps.append(float(np.median(np.diff(time))))
        correlation = np.correlate(part, part, "full")[len(part) - 1 :] / float(part @ part)
        below = np.flatnonzero(correlation <= 0.0)
        total += float(correlation[: below[0] if len(below) else len(correlation)].sum())
    return total / max(len(steps), 1) * float(np.median(steps)) if steps else math.nan
