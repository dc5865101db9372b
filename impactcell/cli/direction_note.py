"""Whether what a campaign's shots say of mu_k goes with their direction."""

import math
from collections.abc import Mapping, Sequence
from statistics import fmean, stdev
from typing import Final

import numpy as np
from scipy.stats import ttest_ind_from_stats

from impactcell.campaign import Campaign, Excitation
from impactcell.records import Capture
from impactcell.records.uncertainty import plus_minus

LEAST_SHOTS: Final = 3
"""Of each direction; fewer do not show how they scatter."""
P_VALUE: Final = 1e-3
"""Chance, at most, of means that lie so far apart where direction is nothing."""
LEAST_SHARE: Final = 0.01
"""Difference, as a share of mu_k, below which nobody needs to know."""


def note_of_direction(campaign: Campaign, mu_k: Mapping[int, float]) -> str:
    """Say that mu_k goes with direction where its means differ clearly (Welch's test); else nothing.

    Parameters
    ----------
    campaign : Campaign
    mu_k : mapping of int to float
        By shot; nan where it shows none.
    """
    known = [shot for shot in campaign.shots if math.isfinite(mu_k.get(shot.cycle, math.nan))]
    is_slide = campaign.excitation is Excitation.FREE_SLIDE
    signs = [_sense(shot) if is_slide else shot.direction for shot in known]
    forward, backward = (
        [mu_k[shot.cycle] for shot, of in zip(known, signs, strict=True) if of == sign] for sign in (1, -1)
    )
    if min(len(forward), len(backward)) < LEAST_SHOTS or not _differ(forward, backward):
        return ""
    ahead, back = (f"{_mean(values)} in {len(values)} shots" for values in (forward, backward))
    return (
        f"mu_k goes with direction: {ahead} along +1, {back} along -1: friction differs by direction, "
        "or the surface is not level; a mean of both is that of neither"
    )


def _sense(slide: Capture) -> int:
    """Which way a free slide went, whatever its direction column says: nothing struck it."""
    if slide.position is None:
        return 0
    return int(np.sign(slide.position.values[-1] - slide.position.values[0]))


def _differ(one: Sequence[float], other: Sequence[float]) -> bool:
    (ahead, ahead_std), (back, back_std) = ((fmean(values), stdev(values)) for values in (one, other))
    if abs(ahead - back) < LEAST_SHARE * fmean((*one, *other)) or ahead_std == back_std == 0.0:
        return False
    test = ttest_ind_from_stats(ahead, ahead_std, len(one), back, back_std, len(other), equal_var=False)
    return float(test.pvalue) < P_VALUE


def _mean(values: Sequence[float]) -> str:
    return plus_minus(fmean(values), stdev(values) / math.sqrt(len(values)), ".4f")
