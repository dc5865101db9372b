"""Records of taps that missed: the force shows no contact."""

import numpy as np
import pytest

from impactcell.campaign import Excitation
from impactcell.errors import MeasurementError
from impactcell.measurements import Given, Imported, guess, make_campaign
from impactcell.web.texts.import_faults import page_fault
from impactcell.web.texts.import_notes import page_note
from tests.unit.measurements.records import PLACE_M, RATE_HZ, recorded, sampled, taps

CONSTANTS = {"mass": 18.9, "velocity": 0.05, "stroke": 1.5e-3}
STRUCK = taps((3000,), (18.9,))


def imported(struck: int, missed: int, trigger: float | None = None) -> Imported:
    """Give what becomes of `struck` files with a tap each and of `missed` ones without."""
    rng = np.random.default_rng(1)
    records = [sampled(STRUCK[number % 2], rng) for number in range(struck)]
    records += [nothing(rng) for _ in range(missed)]
    tables = [recorded(f"data/{number}.csv", record) for number, record in enumerate(records, 1)]
    given = Given(constants=CONSTANTS, excitation=Excitation.TAP, trigger=trigger)
    return make_campaign(tables, guess(tables, given))


def nothing(rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    noise = rng.normal(size=(2, 1200))
    return np.arange(1200) / RATE_HZ, 0.4 * noise[0], PLACE_M + 1.5e-6 * noise[1]


@pytest.mark.parametrize(
    ("missed", "trigger", "told", "german"),
    [
        (1, None, ": 1, in 5.csv", ": 1, in 5.csv"),
        (2, None, ": 2, the first in 5.csv", ": 2, zuerst in 5.csv"),
        (2, 5.0, " of 5 N: 2, the first in 5.csv", ": 2, zuerst in 5.csv"),
    ],
)
def test_a_record_without_contact_beside_others_is_left_out_with_a_word(
    missed: int, trigger: float | None, told: str, german: str
) -> None:
    found = imported(4, missed, trigger)
    assert [shot.direction for shot in found.campaign.shots] == [1, -1, 1, -1]
    note = f"records left out whose force shows no contact{told}: the tap may have missed"
    assert note in found.notes
    said = f"weggelassene Aufzeichnungen, deren Kraft keine Berührung zeigt{german}: der Stoß ging "
    assert page_note(note, "de") == ("de", f"{said}vielleicht daneben")


def test_where_no_record_has_a_contact_a_force_is_advised_only_where_none_was_given() -> None:
    with pytest.raises(MeasurementError) as caught:
        imported(0, 3)
    told = str(caught.value)
    assert "data/1.csv: the force shows no contact (largest" in told
    assert "the tap may have missed; leave the record out, give its threshold with --trigger, or" in told
    told = told.removesuffix(" (and 2 more like this)")
    assert page_fault(told, "de")[1].startswith("data/1.csv: die Kraft zeigt keine Berührung (höchstens ")
    with pytest.raises(MeasurementError) as caught:
        imported(0, 3, 5.0)
    told = str(caught.value).removesuffix(" (and 2 more like this)")
    assert told.startswith("data/1.csv: the force shows no contact of 5 N (largest ")
    assert told.endswith("the tap may have missed; leave the record out, or say --excitation driven")
    german = page_fault(told, "de")[1]
    assert german.startswith("data/1.csv: die Kraft zeigt keine Berührung mit 5 N, wie unten im Formular ")
    assert german.endswith("der Stoß ging vielleicht daneben; die Aufzeichnung weglassen")
