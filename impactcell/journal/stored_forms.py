"""What a journal keeps besides numbers and captures: a cell's state, transitions of its alarms, its model.

Each says its format and is read by every later version; see `impactcell.serialization`.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

from impactcell import alarms
from impactcell.cell import CellState
from impactcell.errors import JournalError
from impactcell.journal.migrations import ALARM_MIGRATIONS, ALARM_NAMES_1, MODEL_MIGRATIONS, STATE_MIGRATIONS
from impactcell.positioning import PlannerPosterior
from impactcell.prediction import Model
from impactcell.records import Alarm, CycleId, Snapshot
from impactcell.serialization import Versioned
from impactcell.serialization.json_text import load_tree
from impactcell.serialization.tree import Unknown
from impactcell.tracking.model_gap.gap_cusum import GapState
from impactcell.tracking.signature.tracker import SignatureState
from impactcell.tracking.wear_batch import TrackerState


@dataclass(frozen=True, slots=True, eq=False)
class StoredState:
    """What a restart goes on from: the state, the last snapshot, what the planner has learned, what is done.

    The alarms of the snapshot are not stored: they are those of the state. `last` is the last cycle that the
    state has taken in, None where a version before format 4 wrote it: the module may still show that cycle,
    and a journal begun anew has no row of it. `handled_target` is the module's session and the sequence of
    the PLC's target whose task has ended, however it did: the module shows it, and nobody wants it again.
    """

    cell: CellState
    snapshot: Snapshot | None = None
    planner: PlannerPosterior | None = None
    last: CycleId | None = None
    handled_target: tuple[int, int] | None = None


STATE: Final = Versioned("the state", StoredState, STATE_MIGRATIONS)
ALARM: Final = Versioned("an alarm", Alarm, ALARM_MIGRATIONS)
MODEL: Final = Versioned("the model", Model, MODEL_MIGRATIONS)
_KNOWN_ALARMS: Final = {*ALARM_NAMES_1, *alarms.NAMES}


def load_alarm(record: str) -> Alarm | None:
    """Read an alarm of this or any earlier format; None for a condition that this version does not know.

    Raises
    ------
    ValueError
        It is of a later format, damaged, or not an alarm.
    """
    tree = load_tree(record)
    content = tree.get("content", tree) if isinstance(tree, dict) else None
    named = content.get("name") if isinstance(content, dict) else None
    if isinstance(named, str) and named not in _KNOWN_ALARMS:
        return None
    return ALARM.loads(record)


def load_alarms(records: Iterable[str]) -> tuple[Alarm, ...]:
    """Read stored alarms; those of conditions that this version does not know are left out.

    Raises
    ------
    JournalError
        One is of a later format.
    """
    try:
        read = [load_alarm(record) for record in records]
    except ValueError as error:
        raise JournalError(f"the journal's alarms cannot be shown: {error}") from error
    return tuple(alarm for alarm in read if alarm is not None)


def pack_state(stored: StoredState, unknown: Unknown | None = None) -> bytes:
    """Write a state, with what an earlier `unpack_state` had to set aside."""
    snapshot = stored.snapshot
    if snapshot is not None:
        stored = replace(stored, snapshot=replace(snapshot, alarms=()))
    return STATE.pack(stored, unknown)


def unpack_state(data: bytes, initial: CellState, unknown: Unknown | None = None) -> StoredState:
    """Read a state of this or any earlier format.

    Parameters
    ----------
    initial : CellState
        Has the alarms that the stored state does not know yet.
    unknown : dict, optional
        Is given the alarms that this version does not know; without it they are refused.

    Raises
    ------
    ValueError
        It is of a later format, damaged, or not a state.
    """
    stored = STATE.unpack(data, StoredState(initial), unknown)
    if stored.snapshot is None:
        return stored
    return replace(stored, snapshot=replace(stored.snapshot, alarms=stored.cell.alarms.alarms))


def upgraded_state(data: bytes) -> bytes | None:
    """Write a state of an earlier format as this version does; None for one that needs nothing.

    Raises
    ------
    ValueError
        It is of a later format, damaged, or not a state.
    """
    unknown = Unknown()
    stored = unpack_state(data, _nothing_yet(), unknown)
    return pack_state(stored, unknown) if STATE.is_older(data) else None


@cache
def _nothing_yet() -> CellState:
    return CellState(
        TrackerState(), SignatureState(), GapState(), alarms.initial_state(alarms.AlarmSettings())
    )
