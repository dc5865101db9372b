"""Shots of which a column is wrong, told by what all other shots have in common.

A campaign of which one mass, velocity or unit is wrong has no plant: a fit that sees that shot misses all of
them. Hidden effects change these ratios too, of shots of the same settings alike; a slip in one row does not.
"""

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from impactcell.discrepancy.data.prepared_shots import FORCE, POSITION, PreparedShot
from impactcell.discrepancy.data.unit_checks import PlausibleRatio, likely_factor
from impactcell.errors import CampaignError
from impactcell.records import Samples

MIN_SHOTS = 6
"""Shots from which on a median says what is usual."""
NEIGHBOURS = 3
"""Shots of the most similar settings that a shot is held against."""
OTHER_DIRECTION = 0.1
"""Distance between directions, as one of velocity or mass by a tenth."""
LARGEST_SLIP = 30.0
"""Factor up to which it is told as it is; beyond, it is one between units."""
BESIDE = 1.3
"""Factor beyond which another ratio of an unlike shot is not like the others' either."""
REVERSED = 2.0
"""Times its largest value a force, or a place from the first on, is negative whose sign is wrong."""
FIRST = 8
"""Samples of the position that tell where a part lies first."""
LAST_PART, FEWEST_LAST = 20, 8
"""Part of a record's positions that tells whether it ends in motion, and as many if there are enough."""
STILL_MOVING = 0.5
"""Speed at the end over the mean one from which on a part is not at rest; of one that slows down it is 0."""
SEVERAL = "position_m or time_s"
"""Columns that are wrong where more than one ratio of a shot is not like the others'."""


def unlike_shots(
    shots: Sequence[PreparedShot], ratios: Sequence[Mapping[PlausibleRatio, float]]
) -> dict[int, str]:
    """Say of each shot that is unlike the others what to check, by number; nothing where most are.

    Parameters
    ----------
    shots : sequence of PreparedShot
    ratios : sequence of mapping
        Of the same shots.
    """
    factors = [dict[PlausibleRatio, float]() for _ in shots]
    turned = {place: said for place, shot in enumerate(shots) if (said := _wrong_sign(shot))}
    unlike = set(turned)
    for ratio in dict.fromkeys(ratio for of_shot in ratios for ratio in of_shot):
        places = [place for place, of_shot in enumerate(ratios) if ratio in of_shot]
        if math.isinf(ratio.far) or len(places) < MIN_SHOTS:
            continue
        values = np.array([max(ratios[place][ratio], 1e-300) for place in places])
        factor = values / np.median(values)
        for i, place in enumerate(places):
            if _is_apart(factor[i], ratio.far) or (
                _is_apart(factor[i], ratio.apart)
                and _is_apart(values[i] / _median_nearby(shots, places, values, i), ratio.apart)
            ):
                unlike.add(place)
            if _is_apart(factor[i], BESIDE):
                factors[place][ratio] = float(factor[i])
    told = {
        shots[place].number: (
            turned.get(place) or _ends_in_motion(shots[place]) or _told(factors[place], ratios[place])
        )
        for place in sorted(unlike)
    }
    return told if 2 * len(told) < len(shots) else {}


def check_signs(shots: Sequence[PreparedShot]) -> None:
    """Notice a force, a position or directions that are turned in most shots.

    Raises
    ------
    CampaignError
        With the column to turn.
    """
    turned = [said for shot in shots if (said := _wrong_sign(shot))]
    if 2 * len(turned) >= max(len(shots), 1):
        raise CampaignError(
            f"a sign is wrong in {len(turned)} of {len(shots)} shots; of the first, {turned[0]}"
        )


def notes_of_unlike(unlike: Mapping[int, str]) -> tuple[str, ...]:
    """Give a sentence for each kind of what is wrong: the first shot in full, and which others."""
    kinds: dict[str, list[int]] = {}
    for number, told in unlike.items():
        kinds.setdefault(re.sub(r"[-+.\d/e]+", "", told), []).append(number)
    notes = []
    for first, *others in kinds.values():
        more = f"; for the like so are {', '.join(map(str, others))}" if others else ""
        notes.append(f"Shot {first} is left out: {unlike[first]}{more}.")
    return tuple(notes)


def _is_apart(factor: float, limit: float) -> bool:
    return not 1.0 / limit <= factor <= limit


def _median_nearby(shots: Sequence[PreparedShot], places: Sequence[int], values: Samples, one: int) -> float:
    """Median of a ratio over the shots whose told settings are most like those of one."""
    this = shots[places[one]]
    distances = np.array([_distance(this, shots[place]) for place in places])
    distances[one] = math.inf
    return float(np.median(values[np.argsort(distances, kind="stable")[:NEIGHBOURS]]))


def _distance(one: PreparedShot, other: PreparedShot) -> float:
    pairs = ((one.velocity_m_s, other.velocity_m_s), (one.mass_kg, other.mass_kg))
    told = [abs(math.log(a / b)) for a, b in pairs if a > 0.0 and b > 0.0]
    return math.fsum(told) + OTHER_DIRECTION * (one.direction != other.direction)


def _wrong_sign(shot: PreparedShot) -> str:
    """Say that a force pulls, or a part that is struck moves the other way, where it does."""
    force, along = shot.values[FORCE], shot.values[POSITION]
    if _is_reversed(force):
        return f"its force_n pulls with {-force.min():.4g} N, where a contact only pushes: turn its sign"
    if shot.velocity_m_s > 0.0 and len(along) > FIRST:
        away = shot.direction * (along - np.median(along[:FIRST]))
        if _is_reversed(away):
            back_mm = -1e3 * away.min()
            return f"its position_m goes {back_mm:.3g} mm against the tap: turn its sign or direction"
    return ""


def _is_reversed(values: Samples) -> bool:
    return len(values) > 0 and float(values.min()) < -REVERSED * max(float(values.max()), 0.0)


def _ends_in_motion(shot: PreparedShot) -> str:
    """Say that a record ends too early, where it does: a speed or a balance of all of it tells of no slip."""
    times, along = shot.times[POSITION], shot.values[POSITION]
    last = max(len(along) // LAST_PART, min(len(along) // 3, FEWEST_LAST))
    if last < 2 or not np.ptp(along) > 0.0:
        return ""
    speed_m_s = abs(float(np.polyfit(times[-last:], along[-last:], 1)[0]))
    mean_speed_m_s = abs(float(along[-1] - along[0])) / float(times[-1] - times[0])
    if speed_m_s < STILL_MOVING * mean_speed_m_s:
        return ""
    return (
        f"its record ends {1e3 * times[-1]:.3g} ms after contact, while the part moves at "
        f"{1e3 * speed_m_s:.3g} mm/s: record until it is at rest"
    )


def _told(off: Mapping[PlausibleRatio, float], known: Mapping[PlausibleRatio, float]) -> str:
    """Say what is unlike the others, which columns to check, and by which factor."""
    (ratio, factor), *others = off.items()
    is_alone = sum(math.isfinite(one.far) for one in known) == 1
    of_one = ratio.columns if is_alone else ratio.column_of_shot
    columns = SEVERAL if others else of_one
    is_of_units = _is_apart(factor, LARGEST_SLIP)
    about = likely_factor(factor, columns) if is_of_units else f"{factor:.2g}"
    return (
        f"{ratio.name} is {factor:.3g} times that of the other shots: check its {columns} "
        f"(off by a factor of about {about})"
    )
