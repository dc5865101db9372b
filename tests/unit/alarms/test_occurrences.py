"""What happens in one cycle and is over, as a shift of the material: called and told each time."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell import alarms
from impactcell.alarms import AlarmEvent, AlarmSetState, AlarmSettings, CycleInputs, EventKind, Notification
from impactcell.records import Evidence, Quality, Signature, WearState
from impactcell.service.factory import alarm_settings
from impactcell.settings import read_cell
from tests.integration.processes import CONFIG

SECOND = 10**9
WEAR = WearState(0.2, 0.001, 0.0, 0.0, 0.25, 0.0, 1.0, 1.0, 1.0, Quality.GOOD)
SHIFT, DEVIANT = "BatchShift", "DeviantCycle"
CALLED = (Notification.EVENT, Notification.ANNUNCIATE)


def shifted(cycle: int) -> CycleInputs:
    return CycleInputs(cycle, WEAR, shift=Evidence(15.0, 11.0, cycle - 2, 0.0001 * cycle, 0.001))


def deviant(cycle: int) -> CycleInputs:
    friction = np.full(2, 0.2)
    signature = Signature(friction, friction, friction, 9.0, 9.0, 0.001, Quality.GOOD)
    evidence = Evidence(9.0, 5.0, cycle, 0.01, 0.002)
    return CycleInputs(cycle, WEAR, signature=signature, deviation=evidence, judged=True)


def usual(cycle: int) -> CycleInputs:
    return CycleInputs(cycle, WEAR, judged=True)


def take(
    settings: AlarmSettings, state: AlarmSetState, inputs: CycleInputs
) -> tuple[AlarmSetState, tuple[alarms.Transition, ...]]:
    results = alarms.evaluate(settings, state, inputs)
    return alarms.update(settings, state, results, inputs.cycle, inputs.cycle * SECOND)


def acknowledge(state: AlarmSetState, name: str) -> AlarmSetState:
    state, done = alarms.apply_event(state, name, AlarmEvent(EventKind.ACKNOWLEDGE, 0, 1, user="ann"))
    assert done.refusal is None
    return state


def of_cell_file(**chosen: int) -> AlarmSettings:
    cell = read_cell(Path(CONFIG / "cells" / "prototype.yaml"))
    section = cell.settings.alarms.model_copy(update=chosen)
    return alarm_settings(replace(cell, settings=cell.settings.model_copy(update={"alarms": section})))


@pytest.mark.parametrize("delay", [1, 5])
@pytest.mark.parametrize(("name", "happens"), [(SHIFT, shifted), (DEVIANT, deviant)])
def test_what_holds_in_one_cycle_comes_with_it_whatever_the_delay_of_the_cell_file(name, happens, delay):
    """An on-delay of one cycle and more switched BatchShift off, for ever and without a word."""
    settings = of_cell_file(on_delay_cycles=delay)
    assert settings.rule("WearLimit").on_delay == settings.rule("ModelGap").on_delay == delay
    state, moved = take(settings, alarms.initial_state(settings), happens(50))
    assert [(t.alarm.name, t.alarm.active, t.notifications) for t in moved] == [(name, True, CALLED)]
    for cycle in range(51, 55):
        state, _ = take(settings, state, usual(cycle))
    assert settings.rule(name).off_delay == alarms.RULES[name].settings.off_delay
    assert of_cell_file(off_delay_cycles=7).rule(name).off_delay == 7


def test_another_shift_while_the_first_still_stands_calls_again():
    """Its alarm stood acknowledged, with the message of the second, and neither journal nor log had it."""
    settings = AlarmSettings()
    state, (first,) = take(settings, alarms.initial_state(settings), shifted(50))
    state = acknowledge(state, SHIFT)
    for cycle in range(51, 72):
        state, moved = take(settings, state, usual(cycle))
        assert moved == ()
    state, (second,) = take(settings, state, shifted(72))
    alarm = second.alarm
    assert second.notifications == CALLED
    assert alarm is state.alarm(SHIFT)
    assert (alarm.active, alarm.acknowledged, alarm.cycle, alarm.time_ns) == (True, False, 72, 72 * SECOND)
    assert "since cycle 70" in alarm.message
    assert alarm.activation > first.alarm.activation


def test_a_shift_whose_alarm_is_silent_is_told_again_without_a_call():
    settings = AlarmSettings()
    state, _ = take(settings, alarms.initial_state(settings), shifted(50))
    shelve = AlarmEvent(EventKind.SHELVE_TIMED, 0, 6, user="ann", shelve_ns=3600 * SECOND)
    state, _ = alarms.apply_event(state, SHIFT, shelve)
    _, (second,) = take(settings, state, shifted(72))
    assert second.notifications == (Notification.EVENT,)


def test_each_deviant_cycle_is_an_event_with_its_own_cycle_and_only_the_first_of_a_run_calls():
    """The event of the second had the number of the first, and journal and log had none of it."""
    settings = AlarmSettings()
    state, (first,) = take(settings, alarms.initial_state(settings), deviant(50))
    assert first.notifications == CALLED
    state = acknowledge(state, DEVIANT)
    for cycle in (51, 53):
        state, (again,) = take(settings, state, deviant(cycle))
        alarm = again.alarm
        assert again.notifications == (Notification.EVENT,)
        assert (alarm.cycle, alarm.time_ns, alarm.evidence.change_cycle) == (cycle, cycle * SECOND, cycle)
        assert f"Cycle {cycle} is unlike" in alarm.message
        assert f"Zyklus {cycle} weicht" in alarm.message_de
        assert (alarm.acknowledged, alarm.activation) == (True, first.alarm.activation)
        state, moved = take(settings, state, usual(cycle + 1))
        assert moved == ()
    # another run, after the alarm has cleared, calls
    state, (cleared,) = take(settings, state, usual(55))
    assert not cleared.alarm.active
    _, (anew,) = take(settings, state, deviant(60))
    assert anew.notifications == CALLED
