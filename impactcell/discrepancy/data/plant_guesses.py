"""First values of a plant's parameters by regression: friction, stiffness and damping."""

from collections.abc import Sequence

import numpy as np

from impactcell.discrepancy.data.prepared_shots import FORCE, POSITION, PreparedShot

MIN_SAMPLES = 12
"""Samples of a channel from which on a regression means anything."""
SLIDE_SAMPLES = 80
"""About as many samples of a slide are read to find where it is."""
SLOW_SHARE = 0.25
"""Share of the largest speed at which a slide counts as ended: below it stiction matters."""
SETTLING_SHARE = 0.2
"""Share of the slide left out at its beginning, where contact may not be over."""
MIN_SLIDE_SAMPLES = 5
"""Samples of a slide that a parabola needs."""
FRICTION_RANGE = (0.005, 2.0)
"""Coefficients of friction that a guess may take."""
USUAL_FRICTION = 0.15
"""Coefficient taken where no slide tells one: steel on carbide, the source paper."""
MIN_LOADING_SAMPLES = 6
"""Samples up to the peak that a regression of stiffness and damping needs."""
RATE_WINDOWS = 15
"""The indentation's rate is smoothed over this share of the loading, one part in fifteen."""


def friction_of_slides(shots: Sequence[PreparedShot], gravity_m_s2: float) -> float:
    """Coefficient of kinetic friction from the curvature of the slides after their fastest moment.

    In free slide x'' = -mu_k g, so that mu_k is twice the negative curvature over g; the median of all shots.
    """
    coefficients = []
    for shot in shots:
        time, position = shot.times[POSITION], shot.values[POSITION] * shot.direction
        if len(time) < MIN_SAMPLES:
            continue
        step = max(len(time) // SLIDE_SAMPLES, 1)
        t, x = time[::step], position[::step]
        speed = np.gradient(x, t)
        first = int(np.argmax(speed))
        slow = np.flatnonzero(speed[first:] < SLOW_SHARE * speed[first])
        last = first + int(slow[0]) if len(slow) else len(t) - 1
        inside = (time >= t[first] + SETTLING_SHARE * (t[last] - t[first])) & (time <= t[last])
        if inside.sum() < MIN_SLIDE_SAMPLES:
            continue
        curvature = np.polyfit(time[inside] - t[first], position[inside], 2)[0]
        if curvature < 0.0:
            coefficients.append(-2.0 * curvature / gravity_m_s2)
    return float(np.clip(np.median(coefficients), *FRICTION_RANGE)) if coefficients else USUAL_FRICTION


def contact_by_regression(shots: Sequence[PreparedShot]) -> tuple[float, float] | None:
    """Stiffness [N/m] and damping [N s/m] by regressing force on indentation and its rate up to the peak.

    None where no shot has force and position.
    """
    estimates = []
    for shot in shots:
        time, force = shot.times[FORCE], shot.values[FORCE]
        if len(time) < MIN_SAMPLES or len(shot.times[POSITION]) < MIN_SAMPLES:
            continue
        peak = int(np.argmax(force))
        if peak < MIN_LOADING_SAMPLES:
            continue
        t = time[:peak]
        x = np.interp(t, shot.times[POSITION], shot.values[POSITION]) * shot.direction
        width = max(len(t) // RATE_WINDOWS, 1)
        smooth = np.convolve(np.pad(x, width, mode="edge"), np.ones(2 * width + 1) / (2 * width + 1), "valid")
        rate = shot.velocity_m_s - np.gradient(smooth, t)
        columns = np.column_stack([shot.velocity_m_s * t - x, rate])
        solution = np.linalg.lstsq(columns, force[:peak], rcond=None)[0]
        if solution[0] > 0.0:
            estimates.append((float(solution[0]), max(float(solution[1]), 0.0)))
    if not estimates:
        return None
    k, b = np.median(np.array(estimates), axis=0)
    return float(k), float(b)
