"""Belief in the model, phase by phase: where it misses, the data say less about its parameters.

A law that the model lacks shows where it acts: fast in the slide, early in the contact, late in it. Residuals
there are of one sign over a whole phase, so a phase that is missed counts as one doubtful observation,
not as many good ones, and what is fitted comes from the phases that the model does describe.
"""

import numpy as np
from numpy.typing import NDArray

from impactcell.prediction.linearised_model import Response
from impactcell.records import Samples

Indices = NDArray[np.intp]

DOUBTED = 1.15
"""Misfit of blocks from which on the model is not believed in every phase alike."""
FORCE_PHASES, CONTACT_PHASES, SLIDE_PHASES = 16, 8, 8
LATER = np.full(FORCE_PHASES + CONTACT_PHASES + SLIDE_PHASES, 30.0)
LATER[: FORCE_PHASES // 4] = LATER[FORCE_PHASES : FORCE_PHASES + CONTACT_PHASES // 4] = 1.0
"""Factor of the standard deviations of each phase once the model is doubted: mu_s is then left to the first
quarter of the contact, where all is slow and laws that depend on speed say little."""


def phases(response: Response, separation_s: float, stop_s: float) -> Indices:
    """Give each block the number of its phase: of contact for force, of contact and slide for position."""

    def along(times: Samples, start: float, end: float, parts: int) -> Indices:
        return np.clip(((times - start) / (end - start) * parts).astype(np.intp), 0, parts - 1)

    force, position = response.force_time_s, response.position_time_s
    first = along(force, 0.0, separation_s, FORCE_PHASES)
    contact = FORCE_PHASES + along(position, 0.0, separation_s, CONTACT_PHASES)
    sliding = FORCE_PHASES + CONTACT_PHASES + along(position, separation_s, stop_s, SLIDE_PHASES)
    return np.concatenate([first, np.where(position < separation_s, contact, sliding)])


def doubt(residual: Samples, phase: Indices) -> Samples:
    """Factor of each residual's standard deviation, shape (n,), 1 where a phase shows no more than noise.

    With r² the mean square of a phase of n blocks beyond what noise makes it, the phase's mean has the
    variance 1/n + r²: as if each of its blocks had 1 + n r².
    """
    size = np.maximum(np.bincount(phase), 1)
    beyond = np.bincount(phase, residual**2) / size - 1.0 - 3.0 * np.sqrt(2.0 / size)
    factor: Samples = np.sqrt(1.0 + size * np.maximum(beyond, 0.0))[phase]
    return factor
