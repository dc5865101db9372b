"""Notices a column that is wrong by a large factor, as millimetres given for metres."""

import math

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.shots import PreparedShot
from impactcell.errors import CampaignError


def check_units(excitation: Excitation, gravity: float, shots: list[PreparedShot]) -> None:
    """Notice a column that is wrong by a large factor.

    The part leaves the actuator at one to two times its velocity, the impulse of the contact makes m v, and
    free of contact friction decelerates at a fraction of g.
    """
    if excitation is Excitation.DRIVEN:
        return
    speeds, impulses, decelerations = [], [], []
    for shot in shots:
        time, position = shot.times[1], shot.values[1]
        if len(time) < 8:
            continue
        step = max(len(time) // 60, 1)
        speed = np.abs(np.diff(position[::step]) / np.diff(time[::step]))
        top = float(np.quantile(speed, 0.95))
        if excitation is Excitation.TAP:
            speeds.append(top / shot.velocity_m_s)
            if len(shot.times[0]) > 8 and math.isfinite(shot.mass_kg):
                impulse = float(np.trapezoid(np.maximum(shot.values[0], 0.0), shot.times[0]))
                impulses.append(impulse / (shot.mass_kg * shot.velocity_m_s))
        else:
            curvature = np.polyfit(time, position, 2)[0]
            decelerations.append(abs(2.0 * curvature) / gravity)
    for values, low, high, what, columns in (
        (
            speeds,
            0.05,
            20.0,
            "the part's speed over the actuator's velocity",
            "position_m, time_s or velocity_mm_per_min",
        ),
        (impulses, 0.02, 50.0, "the impulse of force_n over mass times velocity", "force_n or mass_kg"),
        (decelerations, 1e-4, 20.0, "the deceleration over gravity", "position_m or time_s"),
    ):
        if not values:
            continue
        middle = float(np.median(values))
        if not low < middle < high:
            power = round(math.log10(max(middle, 1e-300)) / 3.0) * 3
            message = (
                f"{what} is {middle:.3g}, where about 1 is possible: check the unit of {columns} "
                f"(off by a factor of about 1e{power:+d})"
            )
            raise CampaignError(message)
