"""Belief in the model, phase by phase: where it misses, the data say less about its parameters.

A law that the model lacks shows where it acts: fast in the slide, early in the contact, late in it. Residuals
there are of one sign over a whole phase, so a phase that is missed counts as one doubtful observation,
not as many good ones, and what is fitted comes from the phases that the model does describe.
"""

import numpy as np
from numpy.typing import NDArray

from impactcell.prediction.linearised_model import LinearisedModel
from impactcell.records import Samples

Indices = NDArray[np.intp]

MISFIT_THRESHOLD = 1.15
"""Misfit of blocks from which on the model is not believed in every phase alike."""
FORCE_INTERVALS, CONTACT_INTERVALS, SLIDE_INTERVALS = 16, 8, 8
"""Intervals that force, and position in the contact and in the slide, are cut into. Our choice."""
LATE_FACTOR = 30.0
"""Factor of the standard deviations of what comes after the first quarter of the contact, once the model is
doubted: mu_s is then left to that quarter, where all is slow and laws that depend on speed say little. Our
choice: a thousandth of the weight."""
LATE_FACTORS = np.concatenate(
    [
        np.where(np.arange(count) < early, 1.0, LATE_FACTOR)
        for count, early in (
            (FORCE_INTERVALS, FORCE_INTERVALS // 4),
            (CONTACT_INTERVALS, CONTACT_INTERVALS // 4),
            (SLIDE_INTERVALS, 0),
        )
    ]
)
"""The same of each interval."""


def interval_of_blocks(response: LinearisedModel, separation_s: float, stop_s: float) -> Indices:
    """Give each block the number of its phase: of contact for force, of contact and slide for position."""

    def along(times: Samples, start: float, end: float, parts: int) -> Indices:
        return np.clip(((times - start) / (end - start) * parts).astype(np.intp), 0, parts - 1)

    force, position = response.force_time_s, response.position_time_s
    first = along(force, 0.0, separation_s, FORCE_INTERVALS)
    contact = FORCE_INTERVALS + along(position, 0.0, separation_s, CONTACT_INTERVALS)
    sliding = FORCE_INTERVALS + CONTACT_INTERVALS + along(position, separation_s, stop_s, SLIDE_INTERVALS)
    return np.concatenate([first, np.where(position < separation_s, contact, sliding)])


def std_factors(residual: Samples, phase: Indices) -> Samples:
    """Factor of each residual's standard deviation, shape (n,), 1 where a phase shows no more than noise.

    With r² the mean square of a phase of n blocks beyond what noise makes it, the phase's mean has the
    variance 1/n + r²: as if each of its blocks had 1 + n r².
    """
    size = np.maximum(np.bincount(phase), 1)
    beyond = np.bincount(phase, residual**2) / size - 1.0 - 3.0 * np.sqrt(2.0 / size)
    factor: Samples = np.sqrt(1.0 + size * np.maximum(beyond, 0.0))[phase]
    return factor
