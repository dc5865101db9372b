"""Forces that push in some taps and pull in others: a load cell for both sides, or a slip."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from impactcell.campaign import Excitation
from impactcell.errors import MeasurementError
from impactcell.measurements import Given, Imported, guess, make_campaign
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.web.texts.import_faults import page_fault
from impactcell.web.texts.import_notes import page_note
from tests.unit.measurements.records import recorded, sampled, taps

CONSTANTS = {"mass": 18.9, "velocity": 0.05, "stroke": 1.5e-3}
STRUCK = taps((3000,), (18.9,)) * 3
TURNED = (
    "force turned in 3 of 6 contacts: its sign goes with the direction of motion (--sign force=1 leaves it)"
)


def records(signs: Sequence[int], offset_n: float = 0.0) -> list[tuple[np.ndarray, ...]]:
    """Give taps to both sides in turn, each with its force times a sign."""
    rng = np.random.default_rng(4)
    found = []
    for tap, sign in zip(STRUCK, signs, strict=True):
        time, force, position = sampled(tap, rng)
        found.append((time, sign * force + offset_n, position))
    return found


def imported(found: Sequence[tuple[np.ndarray, ...]], **given: Any) -> Imported:
    tables = [recorded(f"data/{number}.csv", columns) for number, columns in enumerate(found, 1)]
    return make_campaign(tables, guess(tables, Given(constants=CONSTANTS, **given)))


def check_pushes(found: Imported) -> None:
    assert len(found.campaign.shots) == 6
    for shot, tap in zip(found.campaign.shots, STRUCK, strict=True):
        assert shot.force is not None
        assert shot.direction == tap.direction
        truth = tap.motion().force_n(np.maximum(shot.force.time_s, 0.0)) * (shot.force.time_s > 0.0)
        pushed = truth > 5.0
        assert float(np.median(np.abs(shot.force.values - truth)[pushed])) < 1.5


@pytest.mark.parametrize("sign", [1, -1])
def test_a_force_whose_sign_goes_with_the_motion_is_turned_tap_by_tap(sign: int) -> None:
    found = imported(records([sign * tap.direction for tap in STRUCK], 25.0))
    check_pushes(found)
    assert TURNED in found.notes
    german = "Kraft bei 3 von 6 Berührungen umgekehrt: ihr Vorzeichen geht mit der Bewegungsrichtung"
    assert page_note(TURNED, "de") == ("de", german)
    assert not any("no samples before contact" in note for note in found.notes)


def test_taps_of_one_long_record_are_turned_each() -> None:
    """Those that pull were not seen at all."""
    parts, begin_s = [], 0.0
    for time, force, position in records([tap.direction for tap in STRUCK], 25.0):
        rest = np.arange(1, 5001) * 1e-4
        parts.append(
            (
                begin_s + np.concatenate([time, time[-1] + rest]),
                np.concatenate([force, np.resize(force[:200], 5000)]),
                np.concatenate([position, np.resize(position[-200:], 5000)]),
            )
        )
        begin_s = parts[-1][0][-1] + 1e-4
    whole = tuple(np.concatenate([part[i] for part in parts]) for i in range(3))
    found = imported([whole], excitation=Excitation.TAP)
    check_pushes(found)
    assert TURNED in found.notes


def test_a_file_whose_force_pulls_otherwise_is_named() -> None:
    found = records([1, 1, -1, 1, 1, 1])
    with pytest.raises(MeasurementError) as caught:
        imported(found)
    told = (
        "data/3.csv: the force pulls, where that of others pushes, and its sign does not go with the "
        "direction of motion; turn it in the file, leave the file out, or say --sign force=1 to take all as "
        "they are"
    )
    assert str(caught.value) == told
    assert page_fault(told, "de")[1].endswith("in der Datei umkehren oder die Datei weglassen")
    taken = imported(found, signs={ColumnMeaning.FORCE: 1})
    note = "force that pulls, by the sign that was given, in 1 record, 3.csv"
    assert note in taken.notes
    german = "Kraft, die mit dem angegebenen Vorzeichen zieht, in 1 Aufzeichnung, 3.csv"
    assert page_note(note, "de") == ("de", german)


def test_forces_that_all_push_or_all_pull_are_turned_alike() -> None:
    for sign in (1, -1):
        found = imported(records([sign] * 6, 25.0))
        check_pushes(found)
        told = [note for note in found.notes if note.startswith("force turned")]
        assert len(told) == (sign < 0)
