"""What is said of records beside what is found in them: spikes, commands, clipping, sums, other masses."""

import math
from collections.abc import Sequence

import numpy as np

from impactcell.campaign import COLUMNS
from impactcell.discrepancy.machine.records.lost_stretches import MOST_CLIPPED
from impactcell.discrepancy.machine.records.travel import turns_on
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.records.whole_turns import TURN
from impactcell.discrepancy.machine.terms.base_model import PRIOR_REACH, BaseModel

INERTIA_SHARE = 0.01
"""By how much a mass that two places state may differ: it was weighed to so much."""


def notes_of_records(base: BaseModel, records: Sequence[UniformRecord]) -> list[str]:
    """Say how records were taken."""
    notes = []
    spikes = sum(record.spikes for record in records)
    if spikes:
        samples = sum((2 if record.force.any() else 1) * len(record.position) for record in records)
        notes.append(f"{spikes} of {samples} samples stood far from their neighbours and were replaced.")
    commands = sum(record.force_is_command for record in records)
    if commands:
        notes.append(
            f"The force is held from one update to the next in {commands} of {len(records)} records: it was "
            "taken for a command without noise but for one that is stated, which acts from its sample to the "
            "next."
        )
    unstated = [record for record in records if record.summed_up and not record.noise_is_stated[0]]
    if unstated:
        key = COLUMNS[base.coordinate]["speed_noise"]
        notes.append(
            f"The position was summed up from a speed in {len(unstated)} of {len(records)} records, and its "
            "noise adds up: that was read off neighbouring samples of the speed and taken for white. Of a "
            "speed that was filtered, or made from an encoder's counts, it is not: "
            f"state {key} in campaign.yaml, or record the position itself."
        )
    if turns_on(records, base.coordinate):
        turns = max(float(np.ptp(record.position)) for record in records) / TURN
        notes.append(
            f"Every record turns on one way, through {turns:.0f} turns at most: what changes over them is a "
            "function of the time as well, so that no law of the position is looked for but waves that "
            "repeat with each turn."
        )
    return [*notes, *_notes_of_clipping(records), *_notes_of_inertia(base, records)]


def _notes_of_clipping(records: Sequence[UniformRecord]) -> list[str]:
    """Say in how many records something is clipped and left out, and in how many the drive ends there."""
    notes = []
    if clipped := sum(record.clipped > 0 for record in records):
        notes.append(
            f"Clipped samples of {clipped} of {len(records)} records are left out: nothing counts that lies "
            "in them or near them, and simulations of what is held out begin anew after them."
        )
    if limited := sum(record.at_limit for record in records):
        notes.append(
            f"In {limited} of {len(records)} records the force stands at an end of its range for more than "
            f"{100.0 * MOST_CLIPPED:.0f} % of the time: it was taken for what drives, as of a controller at "
            "its limit. If it is the recorder's range that ends there, choose a wider one."
        )
    return notes


def _notes_of_inertia(base: BaseModel, records: Sequence[UniformRecord]) -> list[str]:
    """Say that what shots.csv states of the inertia is another than the base model's, which goes for all."""
    if not math.isfinite(base.inertia.value):
        return []
    stated, std = base.inertia.value, base.inertia.std
    own = [record for record in records if math.isfinite(record.stated_inertia)]
    if math.isinf(std) and own:
        stated, std = float(np.median([record.stated_inertia for record in own])), 0.0
    off = max(INERTIA_SHARE * stated, PRIOR_REACH * std)
    others = [record for record in own if abs(record.stated_inertia - stated) > off]
    if not others:
        return []
    key, first = COLUMNS[base.coordinate]["mass"], others[0]
    note = (
        f"The base model's {key} goes for all records; shots.csv states another one for {len(others)} of "
        f"{len(records)} shots, first for shot {first.shot} ({first.stated_inertia:.6g}): leave {key} out of "
        "the base model, and each has its own."
    )
    return [note]
