"""The demo tells what its scenario does, and what the cell has to find out by itself."""

from impactcell.demo.scenario_setup import story


def test_a_batch_that_the_plc_keeps_to_itself_is_told_as_such() -> None:
    batches = [
        {"from_cycle": 1, "id": "A"},
        {"from_cycle": 40, "id": "B", "shift": 0.01},
        {"from_cycle": 90, "id": "C", "announced": False},
    ]
    assert story({"wear": {"from_cycle": 1}, "batches": batches}) == (
        (1, "the surface wears: mu_s grows slowly"),
        (40, "batch B is on the table"),
        (90, "batch C is on the table, and the PLC says nothing of it"),
    )
