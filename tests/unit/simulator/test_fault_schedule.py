"""Faults scripted in a scenario: checked when read, and carried out in time."""

import asyncio
import typing
from typing import Any

import pytest
from pydantic import ValidationError

from simulator.fault_schedule import ScheduledFault, arm
from simulator.faults import Fault, FaultInjector, FaultKind


async def test_entries_happen_in_time_and_end() -> None:
    faults, done = FaultInjector(), []
    states: list[bool] = []
    over = asyncio.Event()
    entries = [
        ScheduledFault(at_s=0.01, kind="drop", lasts_s=0.02),
        ScheduledFault(at_s=0.02, kind="overrun", cycles=20),
        ScheduledFault(at_s=0.04, kind="set_counter", value=4_294_967_290),
        ScheduledFault(at_s=0.05, kind="restart"),
    ]
    actions = {
        "overrun": lambda cycles: (done.append(("overrun", cycles)), states.append(faults.active)),
        "set_counter": lambda value: (done.append(("set_counter", value)), states.append(faults.active)),
        "restart": over.set,
    }
    assert len(arm(entries, faults, actions)) == 5
    assert not faults.active
    await over.wait()
    assert done == [("overrun", 20), ("set_counter", 4_294_967_290)]
    assert states == [True, False]


async def test_the_end_of_one_fault_leaves_another_of_its_kind() -> None:
    faults, over = FaultInjector(), asyncio.Event()
    states: list[Fault | None] = []
    entries = [
        ScheduledFault(at_s=0.0, kind="exception", lasts_s=0.01, code=4),
        ScheduledFault(at_s=0.0, kind="exception", lasts_s=0.03, code=5),
        ScheduledFault(at_s=0.02, kind="overrun", cycles=1),
        ScheduledFault(at_s=0.04, kind="restart"),
    ]
    actions = {"overrun": lambda _: states.append(faults.choose()), "restart": over.set}
    arm(entries, faults, actions)
    await over.wait()
    assert [fault and fault.code for fault in states] == [5]
    assert not faults.active


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ({"kind": "overrun"}, "overrun needs cycles"),
        ({"kind": "set_counter"}, "set_counter needs value"),
        ({"kind": "delay", "value": 3}, "delay takes no value"),
        ({"kind": "restart", "lasts_s": 3.0}, "takes no lasts_s"),
        ({"kind": "gremlins"}, "Input should be"),
        ({"kind": "delay", "speed": 1}, "Extra inputs"),
        ({"kind": "delay", "probability": 2.0}, "less than or equal to 1"),
    ],
)
def test_impossible_entries_are_refused(entry: dict[str, Any], told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        ScheduledFault.model_validate({"at_s": 0.0, **entry})


def test_every_kind_of_fault_can_be_scripted() -> None:
    kinds = set(typing.get_args(ScheduledFault.model_fields["kind"].annotation))
    assert {str(kind) for kind in FaultKind} <= kinds
