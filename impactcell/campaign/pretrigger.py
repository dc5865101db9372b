"""Counts the times of taps from first contact, where a record began before it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impactcell.campaign import contacts
from impactcell.campaign.contents import Campaign, Excitation
from impactcell.numerics.raster import step_of
from impactcell.numerics.rest_level import FEWEST, rest_level
from impactcell.numerics.spikes import noise_of
from impactcell.records import Capture, Channel, since_contact, with_open_onset

FEWEST_SAMPLES = 10
"""Samples of force below which no contact is looked for: a baseline and a rise want as many."""
RISE_SHARE = 0.5
"""Rise of the force from the first to the last third before contact, in thresholds of contact, from which on
it was no rest: where a part leans on the actuator to the end, what is taken for no contact is one. A straight
rise up to the threshold makes 0.67 or more."""
FEWEST_AT_REST = 12
"""Samples before contact by which that can be told: four in a third."""
MIN_LATE_STEPS = 3.0
"""Sampling steps by which a contact has to come late before a record is taken to have begun earlier."""
MIN_LATE_S = 1e-3
"""Time by which it has to come late: longer than a sensor lags or a channel is skewed."""
STATED_LATE_S = 5e-3
"""The same where samples before t = 0 say that t = 0 was meant to be the contact."""


def from_contact(campaign: Campaign) -> tuple[Campaign, tuple[str, ...]]:
    """Give a campaign whose taps begin at first contact, and what was done to them.

    The model of a tap begins at first contact: samples before it are left out, and tell where the part lay.
    Where the force of most shots begins later than t = 0, contact is put where it begins.

    Returns
    -------
    campaign : Campaign
    notes : tuple of str
        Empty where nothing was to be done.
    """
    if campaign.excitation is not Excitation.TAP:
        return campaign, ()
    notes: list[str] = []
    shots = _from_onset(campaign.shots, notes)
    kept = tuple(_without_pretrigger(shot) for shot in shots)
    changed = sum(before is not after for before, after in zip(shots, kept, strict=True))
    if changed:
        notes.append(f"Samples before contact (pretrigger) of {changed} shots are left out of the fits.")
    counted = tuple(
        after if after is before else with_open_onset(after)
        for before, after in zip(campaign.shots, kept, strict=True)
    )
    return replace(campaign, shots=counted), tuple(notes)


def late_onset(force: Channel | None) -> int | None:
    """Give the sample at which contact begins; None where that is the first, or no rest before it shows."""
    if force is None or len(force.values) < FEWEST_SAMPLES or np.ptp(force.values) == 0.0:
        return None
    baseline = contacts.baseline_of(force.values)
    found = contacts.contact_onsets(force.time_s, force.values, baseline)
    if not found or found[0] == 0:
        return None
    before = force.values[: found[0]]
    third = len(before) // 3
    rise = float(np.mean(before[-third:]) - np.mean(before[:third])) if len(before) >= FEWEST_AT_REST else 0.0
    return found[0] if rise < RISE_SHARE * baseline.threshold else None


def is_late(lateness_s: float, step_s: float, *, is_stated: bool) -> bool:
    """Whether contact is so far from t = 0 that this is not meant by it; `is_stated`: samples lie before."""
    return abs(lateness_s) >= max(MIN_LATE_STEPS * step_s, STATED_LATE_S if is_stated else MIN_LATE_S)


def _from_onset(shots: Sequence[Capture], notes: list[str]) -> tuple[Capture, ...]:
    onsets = [late_onset(shot.force) for shot in shots]
    late = [
        (shot, shot.force, onset)
        for shot, onset in zip(shots, onsets, strict=True)
        if onset is not None and shot.force
    ]
    if not late or 2 * len(late) < len(shots):
        return tuple(shots)
    step = float(np.median([np.median(np.diff(force.time_s)) for _, force, _ in late]))
    lateness = float(np.median([force.time_s[onset] for _, force, onset in late]))
    is_stated = any(force.time_s[0] < 0.0 for _, force, _ in late)
    if not is_late(lateness, step, is_stated=is_stated):
        return tuple(shots)
    starts = contacts.onset_within_sample(
        [force.time_s for _, force, _ in late],
        [force.values - float(np.median(force.values[: max(onset - 1, 1)])) for _, force, onset in late],
        [onset for _, _, onset in late],
        [shot.velocity_m_s for shot, _, _ in late],
    )
    notes.append(
        f"First contact came {1e3 * lateness:.3g} ms after t = 0: times of {len(late)} shots are counted "
        f"from where their "
        f"force begins, good to a part of the sampling step of {1e3 * step:.3g} ms."
    )
    moved = {shot.cycle: start for (shot, _, _), start in zip(late, starts, strict=True)}
    return tuple(_counted_from(shot, moved[shot.cycle]) if shot.cycle in moved else shot for shot in shots)


def _counted_from(shot: Capture, start_s: float) -> Capture:
    def moved(channel: Channel | None) -> Channel | None:
        return None if channel is None else replace(channel, time_s=channel.time_s - start_s)

    return replace(
        shot, force=moved(shot.force), position=moved(shot.position), actuator=moved(shot.actuator)
    )


def _without_pretrigger(shot: Capture) -> Capture:
    channels = (shot.force, shot.position, shot.actuator)
    if not any(
        channel is not None and len(channel.time_s) and channel.time_s[0] < 0.0 for channel in channels
    ):
        return shot

    def kept(channel: Channel | None) -> Channel | None:
        if channel is None:
            return None
        since = since_contact(channel.time_s)
        values = channel.values[since]
        return replace(channel, time_s=channel.time_s[since], values=values) if len(values) else channel

    force, position, actuator = map(kept, (shot.force, _from_rest(shot), shot.actuator))
    return replace(shot, force=force, position=position, actuator=actuator)


def _from_rest(shot: Capture) -> Channel | None:
    """Put the position before contact where the part lay: at 0, or at `start_m` if that is nearer.

    A zero that is 2 µm off bends mu_s by a quarter, and nothing after contact shows it.
    """
    position = shot.position
    if position is None:
        return None
    before = position.values[: int(np.searchsorted(position.time_s, 0.0))]
    if len(before) < FEWEST:
        return position
    noise_std = position.noise_std or noise_of(before)
    level, zero_std = rest_level(before, noise_std, step_of(position.values, position.resolution))
    place = shot.start_m if abs(level - shot.start_m) < abs(level) else 0.0
    return replace(position, values=position.values - (level - place), zero_std=zero_std)
