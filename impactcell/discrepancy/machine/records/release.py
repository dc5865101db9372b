"""Where a free swing begins in its record: what lies before its release was done by a hand."""

import math
from collections.abc import Sequence

import numpy as np

from impactcell.discrepancy.machine.records.motion_scale import coarse_speed, period_of
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.errors import CampaignError
from impactcell.records import Samples

GROWN = 0.9
"""Largest angle of a record's first period over its largest of all, below which the swing has grown [1]."""
SHORTEST = 5.0
"""Periods that have to be left after a release."""


def from_release(records: Sequence[UniformRecord]) -> tuple[tuple[UniformRecord, ...], list[str]]:
    """Begin each record at the largest angle of its swing, if that grows first, and say so.

    A free swing about q = 0 only loses energy: where its angles grow something drives it, as a hand that
    lifts it to its release. A record that turns over is left as it is.

    Raises
    ------
    CampaignError
        A swing grows nearly to its end.
    """
    free, notes = [], list[str]()
    for record in records:
        angle = np.abs(record.position)
        largest = int(angle.argmax())
        period = max(round(_period_s(record.position[largest:], record.step_s) / record.step_s), 1)
        has_grown = largest > period and float(angle[:period].max()) < GROWN * float(angle[largest])
        if not has_grown or float(angle[largest]) > math.pi:
            free.append(record)
            continue
        begin_s = float(record.time_s[largest])
        if len(angle) - largest < SHORTEST * period:
            raise CampaignError(
                f"shot {record.shot}: its swing grows until {begin_s:.3g} s, so that something drives it, "
                f"and fewer than {SHORTEST:.0f} periods are left; record what drives it, or a longer swing"
            )
        notes.append(
            f"Shot {record.shot}: what lies before {begin_s:.3g} s is left out, since the swing grows until "
            "then: something drives it."
        )
        free.append(record.part(largest))
    return tuple(free), notes


def _period_s(position: Samples, step_s: float) -> float:
    """Period by speeds over a two thousandth of the samples; of too few samples 0."""
    speed = coarse_speed(position, 2000, step_s)
    return period_of(position, speed) if speed.any() else 0.0
