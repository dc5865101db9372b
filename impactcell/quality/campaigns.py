"""Looks through a campaign for what is wrong with its data, shot by shot and over all shots."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from impactcell.campaign import Campaign, Excitation
from impactcell.campaign.contents import CHANNELS
from impactcell.errors import CampaignError
from impactcell.quality.channel_faults import channel_faults
from impactcell.quality.copies import copies
from impactcell.quality.data_fault import DataFault, Fault
from impactcell.quality.motion_faults import LATE_STEPS, lateness_s, slides
from impactcell.quality.zero_faults import zero_faults
from impactcell.records import Capture

MIN_SHOTS = 6
"""Shots over which a lateness can be told."""
UNUSABLE = (Fault.NO_MOTION, Fault.PRESLIDING_ONLY, Fault.CONSTANT)
"""What leaves nothing to be estimated in a shot."""


def inspect_campaign(campaign: Campaign) -> tuple[DataFault, ...]:
    """Say what is wrong with the data of a campaign, before any physics is blamed."""
    data_faults: list[DataFault] = []
    for shot in campaign.shots:
        for name in CHANNELS:
            channel = getattr(shot, name)
            if channel is not None:
                data_faults += channel_faults(name, channel, shot.cycle)
        motion = slides(shot, campaign.coordinate)
        if motion is not None:
            data_faults.append(motion)
    data_faults += _copied(campaign.shots)
    if campaign.excitation is Excitation.TAP:
        data_faults += _late(campaign.shots)
        data_faults += zero_faults(campaign.shots)
    return tuple(data_faults)


def notes_of(data_faults: Sequence[DataFault]) -> tuple[str, ...]:
    """Give one sentence for each kind of fault of each channel: the first in full, and how many more."""
    by_kind = Counter((data_fault.fault, data_fault.channel) for data_fault in data_faults)
    notes = []
    for (fault, channel), count in by_kind.items():
        first = next(
            data_fault
            for data_fault in data_faults
            if (data_fault.fault, data_fault.channel) == (fault, channel)
        )
        place = "" if first.shot is None else f"shot {first.shot}: "
        more = "" if count == 1 else f"; the like in {count - 1} more shots"
        notes.append(f"Data, {fault}: {place}{first.message}{more}.")
    return tuple(notes)


def refuse_unusable(campaign: Campaign, data_faults: Sequence[DataFault]) -> None:
    """Refuse a campaign of which no shot shows a part that slides.

    Raises
    ------
    CampaignError
        With what is wrong in the first shot.
    """
    unusable = [data_fault for data_fault in data_faults if data_fault.fault in UNUSABLE]
    if campaign.excitation is Excitation.DRIVEN:  # a spring or weight beside friction looks like presliding
        unusable = [data_fault for data_fault in unusable if data_fault.fault is not Fault.PRESLIDING_ONLY]
    faulty = {data_fault.shot for data_fault in unusable}
    if campaign.shots and all(shot.cycle in faulty for shot in campaign.shots):
        first = unusable[0]
        raise CampaignError(f"shot {first.shot}: {first.message} (and so in all {len(campaign.shots)} shots)")


def _copied(shots: Sequence[Capture]) -> list[DataFault]:
    """Tell shots whose samples are those of another."""
    channels = [
        [channel.values for channel in (shot.force, shot.position) if channel is not None] for shot in shots
    ]
    return [
        DataFault(
            Fault.COPY,
            "position" if shots[place].force is None else "force",
            f"its samples are those of shot {shots[first].cycle}, noise and all: one record counts twice; "
            f"leave one of them out, or give the shot its own trace",
            shots[place].cycle,
        )
        for place, first in copies(channels)
    ]


def _late(shots: Sequence[Capture]) -> list[DataFault]:
    lateness = np.array([lateness_s(shot) for shot in shots])
    known = lateness[np.isfinite(lateness)]
    if len(known) < MIN_SHOTS:
        return []
    middle = float(np.median(known))
    step = float(np.median([np.median(np.diff(s.force.time_s)) for s in shots if s.force is not None]))
    if abs(middle) <= LATE_STEPS * step or np.mean(np.abs(known - middle) <= 2.0 * step) < 0.6:
        return []
    which, other = ("force", "position") if middle > 0.0 else ("position", "force")
    told = (
        f"the {which} is recorded {1e3 * abs(middle):.2g} ms after the {other} ({len(known)} shots): "
        f"check filters and "
        f"the clock of that channel before a law is blamed (impactcell import --delay moves it)"
    )
    return [DataFault(Fault.LATE_CHANNEL, which, told)]
