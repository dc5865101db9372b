"""Which condition explains another: none that is disabled; and who ends what taps have raised."""

import math
from dataclasses import replace

import pytest

from impactcell import alarms
from impactcell.alarms import AlarmEvent, AlarmSetState, AlarmSettings, CycleInputs, EventKind
from impactcell.records import Evidence, Quality, TapPredictions, WearState

SETTINGS = AlarmSettings()
NORMAL = alarms.initial_state(SETTINGS)
WEAR = WearState(0.2, 0.001, 0.0, 0.0, 0.25, 0.0, 1.0, 1.0, 1.0, Quality.GOOD)
GAP = Evidence(9.0, 6.6, 6, 1.5, 0.1)
USUAL = CycleInputs(7, WEAR, gap=GAP, gap_exceeds=True)
SHIFT = replace(USUAL, shift=Evidence(15.0, 11.0, 6, 0.02, 0.001))
DEVIANT = replace(USUAL, deviation=Evidence(9.0, 5.0, 7, 0.01, 0.002), judged=True)


def without(*names: str) -> AlarmSetState:
    state = NORMAL
    for name in names:
        state, done = alarms.apply_event(state, name, AlarmEvent(EventKind.DISABLE))
        assert done.refusal is None
    return state


def called(state: AlarmSetState, *cycles: CycleInputs) -> list[str]:
    """Conditions that came active in these cycles, in order."""
    found = []
    for cycle, inputs in enumerate(cycles, 7):
        results = alarms.evaluate(SETTINGS, state, replace(inputs, cycle=cycle))
        state, moved = alarms.update(SETTINGS, state, results, cycle, cycle)
        found += [t.alarm.name for t in moved if t.alarm.active]
    return found


@pytest.mark.parametrize(("inputs", "name"), [(SHIFT, "BatchShift"), (DEVIANT, "DeviantCycle")])
def test_a_gap_of_which_nobody_hears_explains_nothing(inputs, name):
    """Who disabled ModelGap heard of no deviant cycle and of no shift either while the model did not fit."""
    assert called(NORMAL, inputs) == ["ModelGap"]
    assert called(without("ModelGap"), inputs) == [name]


def test_a_worn_surface_of_which_nobody_hears_does_not_end_its_warning():
    worn = replace(WEAR, probability_above_limit=0.999)
    inputs = CycleInputs(7, worn, probability_at_horizon=0.999, horizon=2000.0)
    assert called(NORMAL, *[inputs] * 8) == ["WearLimit"]
    assert called(without("WearLimit"), *[inputs] * 8) == ["WearWarning"]


def test_nothing_waits_for_what_is_disabled():
    rising = replace(SHIFT, gap=replace(GAP, statistic=3.3), gap_exceeds=False)
    assert called(NORMAL, rising) == []
    assert called(without("ModelGap"), rising) == ["BatchShift"]
    off = replace(DEVIANT, gap_exceeds=False, innovation=3.0)
    assert called(without("ModelGap"), off) == called(without("BatchShift"), off) == []
    assert called(without("ModelGap", "BatchShift"), off) == ["DeviantCycle"]


LACKING = TapPredictions(30, lacking=True, depends_on="mass", evidence=Evidence(12.0, 9.2, 0, 0.1, 0.01))
FITTING = replace(LACKING, lacking=False, evidence=replace(LACKING.evidence, statistic=-1.0))
NOTHING = Evidence(threshold=6.6)


def of_gap(state: AlarmSetState, inputs: CycleInputs, cycles: int) -> AlarmSetState:
    for cycle in range(cycles):
        results = alarms.evaluate(SETTINGS, state, replace(inputs, cycle=100 + cycle))
        state, _ = alarms.update(SETTINGS, state, results, 100 + cycle, 0)
    return state


def test_a_gap_that_taps_have_raised_is_ended_by_taps_where_there_is_no_residual():
    """It stood for ever in a cell whose captures show none."""
    inputs = CycleInputs(0, WEAR, gap=NOTHING, predictions=LACKING)
    state = of_gap(NORMAL, inputs, 30)
    assert state.alarm("ModelGap").active
    fits = replace(inputs, predictions=FITTING)
    assert of_gap(state, fits, 20).alarm("ModelGap").active
    assert not of_gap(state, fits, 21).alarm("ModelGap").active


def test_a_gap_that_the_residual_has_raised_stays_while_there_is_none():
    state = of_gap(NORMAL, replace(USUAL, predictions=FITTING), 3)
    silent = CycleInputs(0, WEAR, gap=NOTHING, predictions=FITTING)
    assert of_gap(state, silent, 100).alarm("ModelGap").active
    closed = replace(silent, gap=replace(GAP, statistic=0.0), gap_exceeds=False)
    assert not of_gap(state, closed, 21).alarm("ModelGap").active
    assert math.isnan(NOTHING.statistic)
