"""Every stored key is pinned; what another version stored is kept, or refused with the reason."""

import json
from dataclasses import replace

import pytest

from impactcell import alarms
from impactcell.alarms import NAMES, AlarmSettings
from impactcell.cell import CellState
from impactcell.journal.stored_forms import ALARM, STATE, StoredState, load_alarm, pack_state, unpack_state
from impactcell.records import Alarm, Shelving
from impactcell.serialization import dumps, pack
from impactcell.serialization.json_text import dump_tree, load_tree
from impactcell.serialization.message_pack import pack_tree, unpack_tree
from impactcell.serialization.tree import Unknown
from impactcell.tracking.model_gap.gap_cusum import GapState
from impactcell.tracking.signature.tracker import SignatureState
from impactcell.tracking.wear_batch import TrackerState
from tests.data.pin_stored_forms import PINNED, forms
from tests.snapshots import make_capture, make_snapshot

WHAT_TO_DO = """
What a journal stores has other keys than tests/data/stored-forms.json says: an installed cell could not go on
from what it has learned. If a field was renamed, do one of
 - a row in the rename table of the newest migration in impactcell/journal/migrations.py: old place, new key
   (in a migration of its own, if a version that writes the newest format has been released), or
 - `field(metadata=stored(key="old name"))` on the field, which keeps the stored key.
A new field needs a row in `added`, one that is gone in `dropped`, anything else a `reshape`. A class may be
renamed or moved as you like. Then write the pinned file anew: python -m tests.data.pin_stored_forms
The journals of earlier versions must still be read: tests/unit/service/test_stored_state.py
"""


@pytest.fixture
def initial() -> CellState:
    return CellState(TrackerState(), SignatureState(), GapState(), alarms.initial_state(AlarmSettings()))


def test_every_stored_key_is_pinned():
    # By its text: the order of the keys is stored too.
    assert json.dumps(forms(), indent=1) == json.dumps(json.loads(PINNED.read_text()), indent=1), WHAT_TO_DO


def test_no_name_of_a_class_is_stored(initial: CellState):
    data = pack_state(StoredState(initial, make_snapshot(make_capture())))
    for name in (b"State", b"Snapshot", b"Alarm", b"Coefficient", b"Reference"):
        assert name not in data


def test_the_alarms_of_the_snapshot_are_those_of_the_state(initial: CellState):
    stored = unpack_state(pack_state(StoredState(initial, make_snapshot(make_capture()))), initial)
    assert stored.snapshot is not None
    assert [dumps(a) for a in stored.snapshot.alarms] == [dumps(a) for a in initial.alarms.alarms]


def worn(initial: CellState) -> CellState:
    """State with an alarm that people have seen."""
    alarm = replace(initial.alarms.alarm("WearLimit"), active=True, acknowledged=False, comment="seen")
    shown = tuple(alarm if a.name == alarm.name else a for a in initial.alarms.alarms)
    return replace(initial, cycle=7, alarms=replace(initial.alarms, alarms=shown))


@pytest.mark.parametrize("absent", NAMES)
def test_an_alarm_that_an_earlier_version_did_not_know_begins_as_in_a_new_cell(
    initial: CellState, absent: str
):
    envelope = unpack_tree(pack_state(StoredState(worn(initial))))
    kept = envelope["content"]["cell"]["alarms"]
    for member in (members for members in kept.values() if isinstance(members, dict)):
        del member[absent]
    fresh = replace(initial, alarms=alarms.initial_state(AlarmSettings()))
    read = unpack_state(pack_tree(envelope), fresh).cell
    expected = initial if absent == "WearLimit" else worn(initial)
    assert pack(read.alarms) == pack(expected.alarms)
    assert read.cycle == 7


def test_an_alarm_that_only_a_later_version_knows_is_kept_for_it(initial: CellState):
    envelope = unpack_tree(pack_state(StoredState(worn(initial))))
    kept = envelope["content"]["cell"]["alarms"]
    for members in (members for members in kept.values() if isinstance(members, dict)):
        members["FrictionJump"] = {"its": "own"}
    later = pack_tree(envelope)
    with pytest.raises(ValueError, match="holds FrictionJump, which this version does not know"):
        unpack_state(later, initial)
    unknown = Unknown()
    stored = unpack_state(later, initial, unknown)
    assert pack(stored.cell.alarms) == pack(worn(initial).alarms)
    assert pack_state(stored, unknown) == later


def test_an_unknown_quantity_is_refused_with_its_place(initial: CellState):
    envelope = unpack_tree(pack_state(StoredState(initial)))
    envelope["content"]["cell"]["tracker"]["temperature"] = 20.0
    with pytest.raises(
        ValueError, match=r"cell\.tracker holds 'temperature', which this version does not know"
    ):
        unpack_state(pack_tree(envelope), initial)


def test_a_later_state_is_refused(initial: CellState):
    envelope = {**unpack_tree(pack_state(StoredState(initial))), "format": STATE.format + 1}
    with pytest.raises(
        ValueError, match=f"is of format {STATE.format + 1}, this version knows up to {STATE.format}"
    ):
        unpack_state(pack_tree(envelope), initial)


def test_a_transition_of_an_alarm_that_is_not_known_is_left_out_and_of_a_later_format_refused():
    alarm = Alarm("BatchShift", shelving=Shelving.ONE_SHOT, message="µ lower")
    record = ALARM.dumps(alarm)
    assert dumps(load_alarm(record)) == dumps(alarm)
    envelope = load_tree(record)
    envelope["content"]["name"] = "FrictionJump"
    assert load_alarm(dump_tree(envelope)) is None
    with pytest.raises(ValueError, match="an alarm is of format 9"):
        load_alarm(dump_tree({**load_tree(record), "format": 9}))


@pytest.mark.parametrize(("active", "since"), [(True, 41), (False, 0)])
def test_an_alarm_of_format_2_is_active_since_its_activation_and_its_comment_of_its_user(
    initial: CellState, active: bool, since: int
):
    """Nothing else of it was kept: it had moved on at 43."""
    stored = load_tree(
        ALARM.dumps(Alarm("WearLimit", active=active, time_ns=43, activation=41, comment="seen", user="ann"))
    )["content"]
    for later in ("active_ns", "enabled_ns", "comment_ns", "comment_user"):
        del stored[later]
    read = load_alarm(dump_tree({"format": 2, "content": stored}))
    assert read is not None
    assert (read.active_ns, read.enabled_ns, read.comment_ns, read.comment_user) == (since, 0, 0, "ann")
    state = unpack_tree(pack_state(StoredState(initial)))
    for alarm in state["content"]["cell"]["alarms"]["alarms"].values():
        alarm |= {"active": active, "activation": 41}
        for later in ("active_ns", "enabled_ns", "comment_ns", "comment_user"):
            del alarm[later]
    cell = unpack_state(pack_tree({**state, "format": 12}), initial).cell
    assert {alarm.active_ns for alarm in cell.alarms.alarms} == {since}
