"""Zero of the force over the shots of a campaign: whether it drifts, or is another one in each shot."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.numerics.spikes import noise_of
from impactcell.quality.data_fault import DataFault, Fault
from impactcell.records import Capture, Samples

DRIFT_SHARE = 0.01
"""Change of the force at rest over a campaign, as a share of its largest force, from which on it is told."""
DRIFT_STD = 6.0
"""The same in standard deviations of the scatter about its trend."""
LOW_SHARE, REST_STD, MIN_REST_SHARE = 0.05, 5.0, 0.2
"""The force at rest is the median of what is within so many standard deviations of its lowest twentieth, if
that is a fifth of the record at least: else it has hardly been recorded."""
WANDER_STD, WANDER_NOISE = 2.5, 0.5
"""Scatter of the force at rest from shot to shot, from which on its zero wanders: in what the two halves of
each shot's rest make of it, and in standard deviations of the samples there. The first is beyond hum and what
neighbouring samples share, the second where a gap of 1 becomes one of 1.12."""
MIN_SHOTS = 6
"""Shots over which any of this can be told."""


@dataclass(frozen=True, slots=True)
class Rest:
    """Force of a shot without contact.

    Attributes
    ----------
    level : float
        Its median [N]; nan where the record shows hardly any.
    apart : float
        By how much the medians of its two halves differ [N].
    scatter : float
        Standard deviation of its samples [N].
    """

    level: float
    apart: float
    scatter: float


def zero_faults(shots: Sequence[Capture]) -> list[DataFault]:
    """Say what is wrong with the zero of the force, where that shows over all shots."""
    forces = [
        shot.force.values for shot in shots if shot.force is not None and np.ptp(shot.force.values) > 0.0
    ]
    seen = [(force, rest) for force in forces if math.isfinite((rest := _rest(force)).level)]
    rests = [rest for _, rest in seen]
    if len(rests) < MIN_SHOTS:
        return []
    level = np.array([rest.level for rest in rests])
    place = np.arange(len(level), dtype=np.float64)
    slope, start = np.polyfit(place, level, 1)
    scatter = float(np.std(level - (start + slope * place)))
    largest = float(np.median([force.max() for force, _ in seen]))
    return _drifts(float(start), float(slope), len(level), scatter, largest) or _wanders(scatter, rests)


def _rest(force: Samples) -> Rest:
    low, noise = float(np.quantile(force, LOW_SHARE)), noise_of(force)
    near = force[np.abs(force - low) < REST_STD * max(noise, 1e-12)]
    if len(near) < max(MIN_REST_SHARE * len(force), 2):
        return Rest(math.nan, math.nan, math.nan)
    first, second = (float(np.median(half)) for half in np.array_split(near, 2))
    return Rest(float(np.median(near)), second - first, float(near.std()))


def _drifts(start: float, slope: float, shots: int, scatter: float, largest: float) -> list[DataFault]:
    change = slope * (shots - 1)
    error = scatter * math.sqrt(12.0 / shots)
    if abs(change) < max(DRIFT_SHARE * largest, DRIFT_STD * error):
        return []
    told = (
        f"the force at rest goes from {start:.3g} N to {start + change:.3g} N over {shots} shots: "
        f"tare the sensor, let it warm up"
    )
    return [DataFault(Fault.DRIFT, "force", told)]


def _wanders(scatter: float, rests: Sequence[Rest]) -> list[DataFault]:
    by_halves = 0.5 * math.sqrt(np.mean([rest.apart**2 for rest in rests]))
    noise = float(np.median([rest.scatter for rest in rests]))
    if not (noise > 0.0 and scatter > max(WANDER_STD * by_halves, WANDER_NOISE * noise)):
        return []
    told = (
        f"the force at rest is another one in each shot, by {scatter:.2g} N, {scatter / noise:.2g} times its "
        f"noise: its zero wanders, unless parts still touch the actuator there; tare the sensor before each "
        f"tap, look at its amplifier, or record some time before contact, of which `impactcell import` takes "
        f"the zero off"
    )
    return [DataFault(Fault.DRIFT, "force", told)]
