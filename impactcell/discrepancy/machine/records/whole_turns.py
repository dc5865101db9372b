"""Angles whose sensor begins anew after each turn, made to go on; others that begin anew are refused.

A wrap is a jump that, but for a whole turn, goes on as the steps about it do, in a record that stays within
one turn. No motion that is sampled finely enough for anything does that; one that turns on has more than a
turn's range, and one that is fast has steps about it as large.
"""

import math
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter, percentile_filter

from impactcell.campaign import COLUMNS, Campaign, Coordinate
from impactcell.discrepancy.machine.records.channel_values import LARGEST
from impactcell.errors import CampaignError
from impactcell.quality import gaps_in_time
from impactcell.records import Capture, Channel, Samples

TURN = 2.0 * math.pi
"""[rad]."""
NEAR = 0.02
"""Share of a turn by which a wrap less a whole one may differ from the steps about it; of a range as well."""
SLOW, SLOW_PERCENT = 0.2, 30.0
"""Share of a turn below which a step is small beside a wrap, and how many of those about one are, at least: a
part that rests where its sensor begins anew jumps every other time."""
ABOUT = 11
"""Steps about a wrap by which it is told."""
FAR_BACK, ALIKE, OFTEN = 0.5, 0.1, 3
"""Share of a record's range that a jump back has to be, by which such jumps may differ, and how many there
are, of a sensor that begins anew after something else than a turn. Our choice."""


def without_wraps(campaign: Campaign) -> tuple[Campaign, list[str]]:
    """Let the angles of a rotation go on where their sensor begins anew, and say so.

    Such a record begins within half a turn of 0; those without a wrap are left as they are.
    """
    if campaign.coordinate is not Coordinate.ROTATION:
        return campaign, []
    shots = tuple(_going_on(shot) for shot in campaign.shots)
    changed = sum(shot is not before for shot, before in zip(shots, campaign.shots, strict=True))
    if not changed:
        return campaign, []
    note = (
        f"The angle jumps by a whole turn in {changed} of {len(shots)} records: its sensor begins anew after "
        "each turn, and the angle was taken to go on."
    )
    return replace(campaign, shots=shots), [note]


def refuse_saw_teeth(campaign: Campaign) -> None:
    """Refuse positions that jump back by their whole range again and again, all one way.

    A sensor does so that begins anew after something else than a turn, and an angle of which the unit is
    another one.

    Raises
    ------
    CampaignError
        With the shot, the size of its jumps, and the way out.
    """
    unit = "rad" if campaign.coordinate is Coordinate.ROTATION else "m"
    for shot in campaign.shots:
        size = 0.0 if shot.position is None else _saw_tooth(shot.position)
        if not size:
            continue
        turn = f" (a turn is {TURN:.4g} rad)" if unit == "rad" else ""
        raise CampaignError(
            f"shot {shot.cycle}: {COLUMNS[campaign.coordinate]['position']} jumps back by {size:.2g} {unit} "
            f"again and again, as a sensor does that begins anew{turn}: see its unit, or let it go on beyond "
            "each jump"
        )


def _saw_tooth(position: Channel) -> float:
    """Give what a saw tooth goes through until it begins anew; 0 where a position is none."""
    low, high = np.quantile(position.values, [1.0 - LARGEST, LARGEST])
    steps = np.diff(position.values)
    steps[gaps_in_time(position.time_s)] = 0.0
    is_far = np.abs(steps) > FAR_BACK * (high - low)
    jumps = steps[is_far]
    if jumps.size < OFTEN or np.median(np.abs(steps)) > SLOW * (high - low):
        return 0.0
    size = float(np.median(jumps))
    one_way = bool(np.all(jumps * size > 0.0))
    are_alike = bool(np.all(np.abs(jumps - size) <= ALIKE * abs(size)))
    return abs(size - float(np.median(steps))) if one_way and are_alike else 0.0


def _going_on(shot: Capture) -> Capture:
    angle = shot.position
    turns = None if angle is None else _turns(angle)
    if angle is None or turns is None:
        return shot
    values = angle.values - TURN * turns
    return replace(shot, position=replace(angle, values=values - TURN * round(float(values[0]) / TURN)))


def _turns(angle: Channel) -> Samples | None:
    """Count the turns that each sample is ahead of the first; None where none shows, shape (n,)."""
    values = angle.values
    low, high = np.quantile(values, [1.0 - LARGEST, LARGEST])
    steps = np.diff(values)
    jumps = np.rint(steps / TURN)
    if not jumps.any() or high - low > (1.0 + NEAR) * TURN:
        return None
    left = steps - TURN * jumps
    apart = np.abs(left - median_filter(left, ABOUT, mode="mirror"))
    is_wrap = (jumps != 0.0) & (np.maximum(apart, median_filter(apart, ABOUT, mode="mirror")) <= NEAR * TURN)
    is_wrap &= percentile_filter(np.abs(steps), SLOW_PERCENT, ABOUT, mode="mirror") <= SLOW * TURN
    is_wrap[gaps_in_time(angle.time_s)] = False  # a part may have gone anywhere meanwhile
    # Where a sensor does so once, a jump of more than half a turn is no motion anywhere else.
    return np.concatenate([[0.0], np.cumsum(jumps)]) if is_wrap.any() else None
