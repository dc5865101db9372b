"""Where in a sampling step contact lies, of taps whose recorder tells it by its samples only.

Where a record begins before contact, t = 0 is put where the force begins, good to a part of a step. At
0.05 m/s the force of a stiff contact rises by 3 N in 0.1 ms: half a step beside it no plant explains the
taps.
"""

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import replace

import numpy as np

from impactcell.errors import NotConvergedError
from impactcell.features import Features, extract
from impactcell.prediction.joint_plant_fit import fit_plant
from impactcell.prediction.plant_fit import PlantFit
from impactcell.records import Capture, Channel

TRIED_SHARES = (0.0, -0.25, 0.25, -0.5, 0.5)
"""Moments of contact that are tried, in sampling steps of the force: as far as a step is wide."""
GAP_ENOUGH = 1.05
"""Gap at which the first moment is left as it is: the taps then show no other. Our choice."""
Tried = tuple[float, PlantFit, Sequence[Features]]


def fit_plant_and_onset(
    taps: Sequence[Features], gravity_m_s2: float, begun_before: AbstractSet[int], name: str = "fitted"
) -> tuple[PlantFit, Sequence[Features], float]:
    """Fit the plant with contact of some taps anywhere within half a sampling step of t = 0.

    One moment for all of them: how each lies beside the others is known from their forces.

    Parameters
    ----------
    taps : sequence of Features
    gravity_m_s2 : float
    begun_before : set of int
        Cycle numbers of the taps whose contact is known to a step only.
    name : str
        Of the model.

    Returns
    -------
    fit : PlantFit
    taps : sequence of Features
        With times that count from the contact that was found.
    onset_s : float
        Moment of contact by the times that were given.

    Raises
    ------
    PredictionError
        As `fit_plant`, where it does so at every moment.
    """
    moved = [tap.capture.cycle in begun_before for tap in taps]
    steps = [_step_s(tap.capture.force) for tap, open_onset in zip(taps, moved, strict=True) if open_onset]
    step_s = float(np.median(steps)) if steps else 0.0

    def tried(onset_s: float) -> Tried:
        later = [
            _counted_from(tap, onset_s) if onset_s and open_onset else tap
            for tap, open_onset in zip(taps, moved, strict=True)
        ]
        return onset_s, fit_plant(later, gravity_m_s2, name), later

    if not step_s > 0.0:
        _, fit, _ = tried(0.0)
        return fit, taps, 0.0
    found: list[Tried] = []
    fault: NotConvergedError | None = None
    for share in TRIED_SHARES:
        try:
            found.append(tried(share * step_s))
        except NotConvergedError as error:
            fault = error
        if share == 0.0 and found and found[0][1].gap < GAP_ENOUGH:
            break
    if not found:
        raise fault or NotConvergedError("the plant could not be fitted to the campaign")
    found.sort(key=lambda one: one[1].gap)
    if len(found) > 2 and math.isfinite(onset_s := _lowest([(s, fit.gap**2) for s, fit, _ in found[:3]])):
        with suppress(NotConvergedError):  # then the best of the others stands
            found.append(tried(float(np.clip(onset_s, -0.5 * step_s, 0.5 * step_s))))
    onset_s, fit, shifted = min(found, key=lambda one: one[1].gap)
    return fit, shifted, onset_s


def _lowest(points: Sequence[tuple[float, float]]) -> float:
    """Where the parabola through three points is lowest; nan where it has no lowest point."""
    places, heights = np.array(points).T
    scale = float(np.ptp(places))
    a, b, _ = np.polyfit(places / scale, heights, 2).tolist()
    return -0.5 * b / a * scale if a > 0.0 else math.nan


def _step_s(force: Channel | None) -> float:
    return (
        float(np.median(np.diff(force.time_s))) if force is not None and len(force.time_s) > 1 else math.nan
    )


def _counted_from(tap: Features, onset_s: float) -> Features:
    """Give a tap whose times count from another moment; samples that then lie before it are left out."""

    def from_onset(channel: Channel | None) -> Channel | None:
        if channel is None:
            return None
        since = channel.time_s > onset_s
        return replace(channel, time_s=channel.time_s[since] - onset_s, values=channel.values[since])

    capture: Capture = tap.capture
    force, position, actuator = map(from_onset, (capture.force, capture.position, capture.actuator))
    return extract(replace(capture, force=force, position=position, actuator=actuator))
