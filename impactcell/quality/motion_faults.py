"""What the channels of a shot say together: whether the part slides, and whether a channel is late."""

import math

import numpy as np

from impactcell.campaign import Coordinate
from impactcell.campaign.contacts import baseline_of
from impactcell.numerics.spikes import noise_of
from impactcell.quality.data_fault import DataFault, Fault
from impactcell.records import Capture, Channel, Samples

MOTION_STD = 8.0
"""Motion that is one, in standard deviations of the mean of the samples it is told by."""
END_SHARE = 0.05
"""Share of a record at its begin and end by which is told where the part lay and came to rest."""
ELASTIC_CORRELATION = 0.98
"""Correlation of force and position from which on a driven part is on a spring, as in stick."""
MAX_LATE_S = 5e-3
"""Largest lateness looked for: a third of a contact."""
FINEST_LATENESS_S = 1e-5
"""Least step in which a lateness is looked for: a thousand of them, however fast a channel was sampled."""
LATE_STEPS = 1.0
"""Sampling steps by which a channel has to be late to be told: less is what a trigger leaves open."""
MIN_FALL = 40.0
"""Fall of the sum of squares, in units of the noise, for a lateness to be told; chance makes 4."""
MAX_LEFT = 1.5
"""What it may leave, over the noise: else something else than lateness is there too."""
MIN_CONTACT_SAMPLES = 20
"""Samples of a contact by which its lateness can be told."""


def slides(shot: Capture, coordinate: Coordinate) -> DataFault | None:
    """Say whether a recorded part moves beyond noise, and stays where it has moved to; None where it does.

    What turns and comes back without a drive swings: it has no place to stay at.
    """
    position, unit = shot.position, "rad" if coordinate is Coordinate.ROTATION else "m"
    if position is None or len(position.values) < MIN_CONTACT_SAMPLES or np.ptp(position.values) == 0.0:
        return None
    values, noise = position.values, noise_of(position.values)
    count = max(5, round(END_SHARE * len(values)))
    spread = MOTION_STD * noise * math.sqrt(2.0 / count)
    moved = abs(float(np.mean(values[-count:]) - np.mean(values[:count])))
    smooth = np.convolve(values, np.ones(5) / 5.0, "valid")
    excursion = float(np.ptp(smooth))
    if excursion < MOTION_STD * noise * math.sqrt(2.0 / 5.0) or excursion == 0.0:
        span = float(np.ptp(values))
        told = (
            f"the part does not move: its position stays within {span:.3g} {unit}, "
            f"noise is {noise:.2g} {unit}"
        )
        return DataFault(Fault.NO_MOTION, "position", told, shot.cycle)
    if shot.force is not None and math.isnan(shot.velocity_m_s):
        if _on_a_spring(shot.force, position):
            told = (
                "its position follows the force as on a spring: it never slides, or a spring or its "
                "weight outweighs "
                "friction by far; drive it harder"
            )
            return DataFault(Fault.PRESLIDING_ONLY, "position", told, shot.cycle)
        return None
    if coordinate is Coordinate.TRANSLATION and moved < max(spread, 0.02 * excursion):
        told = (
            f"the part never slides: it moves by {excursion:.3g} {unit} and springs back, so all is "
            f"presliding; strike it harder"
        )
        return DataFault(Fault.PRESLIDING_ONLY, "position", told, shot.cycle)
    return None


def _on_a_spring(force: Channel, position: Channel) -> bool:
    driven = np.interp(position.time_s, force.time_s, force.values)
    if np.ptp(driven) == 0.0:
        return False
    return float(np.corrcoef(driven, position.values)[0, 1]) > ELASTIC_CORRELATION


def lateness_s(shot: Capture) -> float:
    """By how much the force of a tap is recorded late against its position [s]; nan where it cannot be told.

    While the part moves in contact, x = c0 + c1 t + A II F(t + tau) - B t²/2, with II the double integral and
    A, B, c0, c1 free, whatever mass and friction are. The tau that leaves least is taken, if it leaves noise,
    and much less than tau = 0 does; 0 else.
    """
    force, position = shot.force, shot.position
    if (
        force is None
        or position is None
        or np.ptp(force.values) == 0.0
        or len(force.values) < MIN_CONTACT_SAMPLES
    ):
        return math.nan
    baseline = baseline_of(force.values)
    touching = np.flatnonzero(force.values - baseline.offset > baseline.threshold)
    if len(touching) < MIN_CONTACT_SAMPLES:
        return math.nan
    begin, end = float(force.time_s[touching[0]]), float(force.time_s[touching[-1]])
    step = max(float(np.median(np.diff(force.time_s))), FINEST_LATENESS_S)
    moving = (position.time_s > begin + 0.25 * (end - begin)) & (position.time_s < end + 0.5 * (end - begin))
    if moving.sum() < MIN_CONTACT_SAMPLES:
        return math.nan
    time, place = position.time_s[moving], position.values[moving]
    shifts = np.arange(-round(MAX_LATE_S / step), round(MAX_LATE_S / step) + 1) * step
    clean = force.values - baseline.offset
    speed = np.concatenate([[0.0], np.cumsum(0.5 * (clean[1:] + clean[:-1]) * np.diff(force.time_s))])
    path = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(force.time_s))])
    left = _left(time, place, np.interp(time[:, None] + shifts, force.time_s, path))
    none, best = float(left[len(left) // 2]), int(left.argmin())
    if best in (0, len(left) - 1) or left[best] > MAX_LEFT * noise_of(position.values):
        return 0.0
    if len(time) * ((none / max(float(left[best]), 1e-300)) ** 2 - 1.0) < MIN_FALL:
        return 0.0
    return float(shifts[best])


def _left(time: Samples, place: Samples, pushed: Samples) -> Samples:
    """Root mean square of what the best free coefficients leave [m], for each column of `pushed`."""
    since = (time - time[0]) / (time[-1] - time[0])
    free, _ = np.linalg.qr(np.stack([np.ones_like(since), since, since**2], axis=1))
    place = place - free @ (free.T @ place)
    pushed = pushed - free @ (free.T @ pushed)
    explained = (pushed.T @ place) ** 2 / np.maximum((pushed**2).sum(axis=0), 1e-300)
    return np.asarray(np.sqrt(np.maximum(place @ place - explained, 0.0) / len(time)), dtype=np.float64)
