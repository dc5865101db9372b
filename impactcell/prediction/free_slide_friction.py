"""Friction of a free slide: no contact, unknown initial speed, mu_k the same until it stops.

`impactcell.features.slide` is for taps: it begins at separation and refuses a part that still moves when its
record ends, as parts do in records of free slides (all 467 of the ContactNets tosses).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import least_squares
from scipy.special import chdtrc

from impactcell.errors import CaptureError
from impactcell.features.channels import check_channel
from impactcell.physics import Plant
from impactcell.physics.free_motion import model_acceleration
from impactcell.prediction.phase_reweighting import MISFIT_THRESHOLD, SLIDE_INTERVALS
from impactcell.records import Capture, Coefficient, Quality, Samples

PARAMETERS = 3
"""Of a slide: where it begins, how fast, and its friction."""
SPEEDS = 256
"""Steps of speed from the first to rest: half or twice as many change no mu_k by 1e-5 of itself."""
LEAST_BRAKING = 1e-3
"""Deceleration, as a share of gravity, below which a part is taken to slow down by this."""
BY_CHANCE = 1e-3
"""Probability from which on noise may have made the residuals of intervals so large. Our choice."""


@dataclass(frozen=True, slots=True)
class FreeSlideFit:
    """What one slide says of mu_k, and how well it is met.

    Attributes
    ----------
    mu_k, mu_k_std : float
        The standard deviation is that of the residuals, of samples or of intervals, whichever is larger, and
        of the position's scale, which mu_k follows.
    common_std : float
        What all slides of a recorder share of it: that of the scale.
    bend : float
        How far friction at either end of the slide is from mu_k, as the residuals have it.
    gap : float
        RMS of the residuals of samples over the sensor's noise; 1 = noise.
    chi2 : float
        Sum of the squares of residuals over noise, of the means of intervals.
    freedom : int
        What it is on average of noise alone.
    """

    mu_k: float
    mu_k_std: float
    common_std: float
    bend: float
    gap: float
    chi2: float
    freedom: int


def fit_free_slide(capture: Capture, gravity_m_s2: float, plant: Plant | None = None) -> FreeSlideFit:
    """Fit x' = v, v' = a(v) - mu_k g until v = 0, then rest, by least squares over x_0, v_0 and mu_k.

    a is what the effects of `plant` do to a free part; without one it is 0.

    Raises
    ------
    CaptureError
        The position cannot be used, nothing slid, or the plant leaves nothing to friction.
    """
    position = check_channel(capture.position, "position")
    times = position.time_s - position.time_s[0]
    sign = 1 if position.values[-1] > position.values[0] else -1
    moved = sign * (position.values - position.values[0])
    if moved[-1] < 6.0 * position.sigma:
        raise CaptureError("the part did not slide")
    of_effects = None
    if plant is not None:
        along = replace(capture, direction=sign)
        of_effects = model_acceleration(replace(plant, gravity_m_s2=gravity_m_s2), along)

    def path(p: Samples) -> CubicHermiteSpline:
        return _path(float(p[1]), float(p[2]), of_effects, LEAST_BRAKING * gravity_m_s2)

    def residual(p: Samples) -> Samples:
        sliding = path(p)
        misfit: Samples = p[0] + sliding(np.minimum(times, sliding.x[-1])) - moved
        return misfit

    early = times <= 0.6 * times[-1]
    curve = np.polyfit(
        times[early] if early.sum() > 4 else times, moved[early] if early.sum() > 4 else moved, 2
    )
    slowing = max(-2.0 * float(curve[0]), 0.05 * gravity_m_s2)
    speed = max(float(curve[1]), math.sqrt(2.0 * slowing * float(moved[-1])))
    braking = slowing if of_effects is None else slowing + float(of_effects(np.array([0.5 * speed]))[0])
    fit = least_squares(residual, [0.0, speed, braking], x_scale=[1e-3, speed, slowing])
    slope = np.asarray(fit.jac)
    try:
        covariance = np.linalg.inv(slope.T @ slope)
    except np.linalg.LinAlgError as fault:
        raise CaptureError("the slide is too short to show its deceleration") from fault
    spread = math.sqrt(2.0 * float(fit.cost) / max(len(times) - PARAMETERS, 1))
    stop_s = min(float(path(fit.x).x[-1]), float(times[-1]))
    chi2, freedom = _of_intervals(times / stop_s, np.asarray(fit.fun) / position.sigma)
    widened = max(spread, position.sigma * math.sqrt(chi2 / freedom))
    mu_k = float(fit.x[2]) / gravity_m_s2
    std = widened * math.sqrt(float(covariance[2, 2])) / gravity_m_s2
    if of_effects is not None and not mu_k > 0.0:
        raise CaptureError("the model's effects slow a part down more than this one was: check its mass")
    if not (mu_k > 0.0 and math.isfinite(std)):
        raise CaptureError("the part did not slow down")
    sliding = times <= stop_s
    cubic = float(np.polyfit(times[sliding] / stop_s, fit.fun[sliding], 3)[0])
    return FreeSlideFit(
        mu_k=mu_k,
        mu_k_std=math.hypot(std, capture.position_scale_std * mu_k),
        common_std=capture.position_scale_std * mu_k,
        bend=3.0 * abs(cubic) / stop_s**2 / gravity_m_s2,
        gap=spread / position.sigma,
        chi2=chi2,
        freedom=freedom,
    )


def misfit(fits: Sequence[FreeSlideFit]) -> float:
    """RMS of the means of residuals over intervals of slides, 1 = noise."""
    return math.sqrt(sum(one.chi2 for one in fits) / sum(one.freedom for one in fits))


def is_missed(fits: Sequence[FreeSlideFit]) -> bool:
    """Whether the residuals of slides, taken together, are more than noise makes them."""
    chi2, freedom = sum(one.chi2 for one in fits), sum(one.freedom for one in fits)
    return chi2 > MISFIT_THRESHOLD**2 * freedom and float(chdtrc(freedom, chi2)) < BY_CHANCE


def free_slide_friction(fit: FreeSlideFit, reason: str = "", *, missed: bool = False) -> Coefficient:
    """Give mu_k of a slide; of one that is `missed` it is less sure by how far its friction bends."""
    if not missed:
        return Coefficient(fit.mu_k, fit.mu_k_std, Quality.GOOD, reason, fit.common_std)
    std = math.hypot(fit.mu_k_std, fit.bend)
    return Coefficient(fit.mu_k, std, Quality.UNCERTAIN, reason, fit.common_std)


def _path(
    speed: float, braking: float, of_effects: Callable[[Samples], Samples] | None, least: float
) -> CubicHermiteSpline:
    """Way over time from `speed` to rest, m; its last time is that of rest. Exact without effects."""
    ends = max(speed, 1e-9) * np.linspace(1.0, 0.0, SPEEDS + 1)
    middles = 0.5 * (ends[1:] + ends[:-1])
    slowing = np.full(SPEEDS, braking) if of_effects is None else braking - of_effects(middles)
    steps = (ends[:-1] - ends[1:]) / np.maximum(slowing, least)
    times, ways = (np.concatenate([[0.0], np.cumsum(one)]) for one in (steps, middles * steps))
    return CubicHermiteSpline(times, ways, ends)


def _of_intervals(shares: Samples, residuals: Samples) -> tuple[float, int]:
    """Chi-square of the means of residuals over eighths of the slide and over the rest, and its freedom."""
    interval = np.minimum(shares * SLIDE_INTERVALS, SLIDE_INTERVALS).astype(np.intp)
    count = np.bincount(interval)
    sums = np.bincount(interval, residuals)[count > 0]
    return float(np.sum(sums**2 / count[count > 0])), max(len(sums) - PARAMETERS, 1)
