"""One cycle as a whole: what goes into the snapshot, what is kept, and what people and faults do to it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell import cell as core
from impactcell.alarms import AlarmEvent, EventKind, Notification
from impactcell.alarms.rules import module_connection
from impactcell.cell import CellDesign, CellState, in_place_of
from impactcell.cell.model_change import model_digest
from impactcell.prediction import PROVISIONAL
from impactcell.records import BatchAnnouncement, Capture, PositioningState, Quality, Shelving
from impactcell.service.factory import cell_design
from impactcell.settings import read_cell
from tests.integration.processes import CONFIG
from tests.taps import Tap

pytestmark = pytest.mark.slow

SECOND = 10**9
LEARNED = 12


@pytest.fixture(scope="module")
def design() -> CellDesign:
    return cell_design(read_cell(CONFIG / "cells" / "prototype.yaml"))


def capture(cycle: int, mu_s: float = 0.2, batch_id: str | None = "A") -> Capture:
    draw = np.random.default_rng([cycle, 9])
    tap = Tap(0.06, mu_s * (1.0 + 0.012 * draw.standard_normal()), stroke_m=1.5e-3)
    return replace(tap.capture(draw, cycle=cycle), time_ns=(cycle + 5) * SECOND, batch_id=batch_id, session=3)


@pytest.fixture(scope="module")
def learned(design: CellDesign) -> CellState:
    state = core.initial_state(design)
    for cycle in range(1, LEARNED + 1):
        state = core.step(design, state, capture(cycle), PositioningState()).state
    return state


def test_the_snapshot_says_all_of_its_cycle(design: CellDesign, learned: CellState) -> None:
    task, given = PositioningState(target_m=0.01, running=True, taps=3), capture(LEARNED + 1)
    done = core.step(design, learned, given, task)
    snapshot, state = done.snapshot, done.state
    assert (snapshot.cycle, snapshot.time_ns) == (given.cycle, given.time_ns)
    assert (snapshot.velocity_m_s, snapshot.mass_kg) == (given.velocity_m_s, given.mass_kg)
    assert snapshot.positioning is task
    assert snapshot.model_name == design.model.name
    assert snapshot.alarms is state.alarms.alarms
    assert snapshot.friction.mu_s.value == pytest.approx(0.2, abs=0.015)
    assert snapshot.friction.mu_s.quality is Quality.GOOD
    assert snapshot.gap == snapshot.friction.gap == pytest.approx(1.0, abs=0.3)
    assert snapshot.gap_quality is Quality.GOOD
    assert snapshot.wear.limit == design.tracker.wear_limit
    assert snapshot.wear.level == pytest.approx(0.2, abs=0.01)
    assert snapshot.batch.batch_id == "A"
    assert snapshot.signature.position_m[-1] == design.signature.length_m
    assert (state.cycle, state.time_ns, state.period_s) == (given.cycle, given.time_ns, pytest.approx(1.0))
    assert state.batch.by_module == "A"
    assert state.tracker.clock.last == given.cycle
    assert state.tracker.clock.session == 3
    assert state.gap.count == LEARNED + 1
    assert done.changed == ()


def test_the_usual_residual_is_uncertain_before_it_is_learned(design: CellDesign) -> None:
    first = core.step(design, core.initial_state(design), capture(1), PositioningState()).snapshot
    assert first.gap_quality is Quality.UNCERTAIN
    blind = replace(capture(1), force=None, position=None)
    nothing = core.step(design, core.initial_state(design), blind, PositioningState())
    assert nothing.snapshot.gap_quality is Quality.BAD
    assert nothing.snapshot.friction.mu_s.quality is Quality.BAD
    assert nothing.notes
    assert nothing.notes[0] == nothing.snapshot.friction.mu_s.reason
    assert len(set(nothing.notes)) == len(nothing.notes)


def test_faults_of_the_fieldbus_are_in_the_estimate_and_the_notes(
    design: CellDesign, learned: CellState
) -> None:
    good = core.step(design, learned, capture(LEARNED + 1), PositioningState())
    assert good.notes == ()
    done = core.step(
        design, learned, capture(LEARNED + 1), PositioningState(), None, ("capture cut short", "late")
    )
    assert done.snapshot.friction.mu_s.quality is Quality.UNCERTAIN
    assert done.notes == ("capture cut short; late",)


def test_wear_is_no_better_than_the_estimates_it_follows(design: CellDesign) -> None:
    """A force 8 % too large is that of a heavier part in every tap alike."""
    state = core.initial_state(design)
    for cycle in range(1, 13):
        tap = capture(cycle)
        assert tap.force is not None
        wrong = replace(tap, force=replace(tap.force, values=1.08 * tap.force.values))
        stepped = core.step(design, state, wrong, PositioningState(), None, ())
        state, snapshot = stepped.state, stepped.snapshot
        assert snapshot.friction.mu_s.quality is Quality.UNCERTAIN
        assert snapshot.wear.quality is Quality.UNCERTAIN
        assert snapshot.wear.reason == snapshot.friction.mu_s.reason
        assert len(stepped.notes) == len(set(stepped.notes))
    right = core.step(design, state, capture(13), PositioningState(), None, ()).snapshot
    assert (right.wear.quality, right.wear.reason) == (Quality.GOOD, "")


def test_defaults_are_filled_in_before_anything_is_estimated(design: CellDesign, learned: CellState) -> None:
    defaults = replace(design.defaults, mass_kg=18.9, stroke_m=1.5e-3)
    bare = replace(capture(LEARNED + 1), mass_kg=math.nan, stroke_m=math.inf)
    done = core.step(replace(design, defaults=defaults), learned, bare, PositioningState())
    whole = core.step(design, learned, capture(LEARNED + 1), PositioningState())
    assert done.snapshot.mass_kg == 18.9
    assert done.snapshot.friction == whole.snapshot.friction


@pytest.mark.parametrize("told", ["by the PLC", "by a person", "by nobody"])
def test_an_announced_batch_is_a_new_baseline_and_no_alarm(
    design: CellDesign, learned: CellState, told: str
) -> None:
    state, announcement = learned, None
    if told == "by the PLC":
        announcement = BatchAnnouncement(1, LEARNED + 1)
    elif told == "by a person":
        state = core.start_batch(learned, "B", expected=True)
        assert state.batch.by_operator is not None
        assert state.batch.by_operator.module_batch_id == "A"
    suppressed = []
    for cycle in range(LEARNED + 1, LEARNED + 4):
        done = core.step(design, state, capture(cycle), PositioningState(), announcement)
        state = done.state
        suppressed.append(state.alarms.alarm("BatchShift").suppressed)
        assert done.snapshot.batch.batch_id == ("B" if told == "by a person" else "A")
    assert suppressed == [told != "by nobody"] * 3
    # the reference of the signature begins anew with another material
    assert state.signature.batch_id == ("B" if told == "by a person" else "A")


def test_a_module_that_restarts_is_followed_from_its_first_cycle_on(
    design: CellDesign, learned: CellState
) -> None:
    state, notes = learned, []
    for cycle in (1, 2, 3):
        again = replace(capture(cycle), session=4, time_ns=(LEARNED + 6 + cycle) * SECOND)
        done = core.step(design, state, again, PositioningState())
        state = done.state
        notes.append(done.notes)
    assert notes == [("cycle numbers restarted at 1",), (), ()]
    assert state.tracker.noise.weight == learned.tracker.noise.weight + 3
    assert state.cycle == 3


def test_a_reset_of_wear_begins_at_the_next_cycle(design: CellDesign, learned: CellState) -> None:
    fresh = core.reset_wear_level(learned, SECOND)
    assert len(fresh.tracker.bank) == 0
    assert (fresh.cycle, fresh.period_s) == (learned.cycle, learned.period_s)
    assert fresh.alarms == learned.alarms
    assert fresh.tracker.noise is learned.tracker.noise
    done = core.step(design, fresh, capture(LEARNED + 1, 0.15), PositioningState())
    assert done.snapshot.wear.level == pytest.approx(done.snapshot.friction.mu_s.value)


def test_a_reset_of_wear_ends_what_was_told_of_the_surface_before(design: CellDesign) -> None:
    """The surface was not renewed after all, and told since when the one before it had been worn."""
    worn = replace(design, tracker=replace(design.tracker, wear_limit=0.15))
    state = core.initial_state(worn)

    def follow(first: int, cycles: int) -> None:
        nonlocal state
        for cycle in range(first, first + cycles):
            state = core.step(worn, state, capture(cycle), PositioningState()).state

    follow(1, LEARNED)
    before = state.alarms.alarm("WearLimit")
    assert before.active
    assert before.evidence.change_cycle <= LEARNED
    state = core.reset_wear_level(state, 99 * SECOND)
    ended = state.alarms.alarm("WearLimit")
    assert (ended.active, ended.acknowledged, ended.cycle, ended.time_ns) == (
        False, False, LEARNED, 99 * SECOND,
    )  # fmt: skip
    follow(LEARNED + 1, 1)
    assert not state.alarms.alarm("WearLimit").active, "delays count anew"
    follow(LEARNED + 2, LEARNED)
    again = state.alarms.alarm("WearLimit")
    assert again.active
    assert again.activation > before.activation
    assert again.evidence.change_cycle > LEARNED


def test_what_happens_beside_the_cycles_carries_the_cycle_and_its_own_time(
    design: CellDesign, learned: CellState
) -> None:
    lost = module_connection.result("refused", connected=False)
    state, (alarm,) = core.apply_rule_result(design, learned, lost, 99 * SECOND)
    assert (alarm.name, alarm.active) == ("ModuleConnection", True)
    assert (alarm.cycle, alarm.time_ns) == (LEARNED, 99 * SECOND)
    assert state.alarms.alarm("ModuleConnection") is alarm
    same, moved = core.apply_rule_result(design, state, lost, 100 * SECOND)
    assert moved == ()
    assert same.alarms.alarms == state.alarms.alarms
    acted, done = core.apply_event(
        state, "ModuleConnection", AlarmEvent(EventKind.SHELVE_TIMED, 0, 100 * SECOND, shelve_ns=SECOND)
    )
    assert done.notifications == (Notification.EVENT,)
    assert (done.alarm.cycle, done.alarm.shelving) == (LEARNED, Shelving.TIMED)
    assert acted.alarms.alarm("ModuleConnection") is done.alarm
    early, moved = core.expire_shelving(acted, 100 * SECOND)
    assert moved == ()
    assert early.alarms == acted.alarms
    late, (over,) = core.expire_shelving(acted, 101 * SECOND)
    assert (over.shelving, over.cycle) == (Shelving.UNSHELVED, LEARNED)
    assert late.alarms.alarm("ModuleConnection") is over
    refused, done = core.apply_event(late, "ModuleConnection", AlarmEvent(EventKind.UNSHELVE))
    assert done.refusal is not None
    assert refused.alarms == late.alarms


def test_cycles_after_a_restart_without_a_session_are_used_as_any_others(design: CellDesign) -> None:
    """Its first ones had the numbers of cycles of before, and were ignored as having come twice."""

    def of_no_session(cycle: int, seed: int) -> Capture:
        return replace(capture(seed), cycle=cycle, session=0, time_ns=(seed + 5) * SECOND)

    state = core.initial_state(design)
    for cycle in range(1, LEARNED + 1):
        state = core.step(design, state, of_no_session(cycle, cycle), PositioningState()).state
    state = replace(state, batch=replace(state.batch, last_announcement=9))
    for cycle in (2, 3, 4):
        done = core.step(
            design, state, of_no_session(cycle, LEARNED + cycle), PositioningState(), restarted=cycle == 2
        )
        assert done.notes == (("cycle numbers restarted at 2",) if cycle == 2 else ())
        assert done.state.tracker.clock.last == state.tracker.clock.last + 1
        assert done.state.batch.last_announcement == 0
        state = done.state
    assert state.tracker.clock.number(state.tracker.clock.last) == 4


def test_a_state_of_another_grid_learns_its_signature_anew(design: CellDesign, learned: CellState) -> None:
    wider = replace(design, signature=replace(design.signature, points=40))
    fitted = core.migrate_state(wider, learned, 99 * SECOND)
    assert len(fitted.signature.reference.mean) != len(learned.signature.reference.mean) or not np.any(
        fitted.signature.reference.mean
    )
    assert fitted.tracker is learned.tracker
    assert fitted.gap is learned.gap
    assert not fitted.model_changed
    assert core.migrate_state(wider, fitted, 99 * SECOND) is fitted
    done = core.step(wider, fitted, capture(LEARNED + 1), PositioningState())
    assert len(done.snapshot.signature.friction) == 40


def test_what_was_learned_by_a_provisional_model_is_learned_anew_and_only_once(
    design: CellDesign, learned: CellState
) -> None:
    """The level of friction by a guessed model stayed the wear level for good, and the true one an offset."""
    guessed = replace(design.model, provenance={PROVISIONAL: "nothing measured"})
    begun = replace(learned, model_digest=model_digest(guessed))
    assert core.migrate_state(replace(design, model=guessed), begun, 99 * SECOND) is begun
    fitted = replace(design, model=in_place_of(guessed, design.model))
    anew = core.migrate_state(fitted, begun, 99 * SECOND)
    assert anew.model_changed
    assert anew.tracker.bank.size == 0
    assert anew.tracker.clock == begun.tracker.clock
    assert anew.batch == begun.batch
    stepped = core.step(fitted, anew, capture(LEARNED + 1, mu_s=0.24), PositioningState())
    assert stepped.snapshot.wear.level == pytest.approx(0.24, abs=0.01)
    assert core.migrate_state(fitted, stepped.state, 99 * SECOND) is stepped.state
    # who calibrates or extends the model afterwards loses nothing, nor does who never had a provisional one
    for model in (replace(fitted.model, name="calibrated"), in_place_of(fitted.model, design.model)):
        assert (
            core.migrate_state(replace(design, model=model), stepped.state, 99 * SECOND).tracker
            is stepped.state.tracker
        )
    assert in_place_of(design.model, guessed) is guessed
    assert in_place_of(guessed, guessed) is guessed
    assert in_place_of(design.model, design.model) is design.model


def test_wear_that_a_provisional_model_told_of_ends_with_it(design: CellDesign, learned: CellState) -> None:
    """Since when the surface was worn was told of the guess, to which the next model has no part."""
    guessed = replace(design.model, provenance={PROVISIONAL: "nothing measured"})
    worn = replace(design, model=guessed, tracker=replace(design.tracker, wear_limit=0.15))
    state = replace(learned, model_digest=model_digest(guessed))
    for cycle in range(LEARNED + 1, LEARNED + 12):
        state = core.step(worn, state, capture(cycle), PositioningState()).state
    assert state.alarms.alarm("WearLimit").active
    kept = core.migrate_state(replace(worn, model=design.model), state, 99 * SECOND)
    assert kept.alarms.alarm("WearLimit").active, "what was learned holds on, and what was told of it"
    fitted = replace(worn, model=in_place_of(guessed, design.model))
    state = core.migrate_state(fitted, state, 99 * SECOND)
    ended = state.alarms.alarm("WearLimit")
    assert (ended.active, ended.acknowledged, ended.time_ns) == (False, False, 99 * SECOND)
    began = state.cycle + 1
    for cycle in range(began, began + 40):
        state = core.step(fitted, state, capture(cycle), PositioningState()).state
    again = state.alarms.alarm("WearLimit")
    assert again.active
    assert again.evidence.change_cycle >= began


def test_a_provisional_model_that_comes_back_finds_no_change_of_the_material(design: CellDesign) -> None:
    """Its estimates scatter with the velocity, which the model before had not: that was told as a change."""

    def struck(cycle: int) -> Capture:
        draw = np.random.default_rng([cycle, 9])
        velocity = (0.04, 0.06, 0.1)[cycle // 12 % 3]
        tap = Tap(velocity, 0.2 * (1.0 + 0.003 * draw.standard_normal()), stroke_m=1.5e-3)
        header = {"time_ns": (cycle + 5) * SECOND, "batch_id": "A", "session": 3}
        return replace(tap.capture(draw, cycle=cycle), **header)  # type: ignore[arg-type]

    state = core.initial_state(design)
    for cycle in range(1, 61):
        state = core.step(design, state, struck(cycle), PositioningState()).state
    plant = replace(design.model.plant, stiffness_n_per_m=5.2e5)
    guessed = replace(design.model, plant=plant, provenance={PROVISIONAL: "nothing measured"})
    restored = replace(design, model=guessed)
    state = core.migrate_state(restored, state, 99 * SECOND)
    called = []
    for cycle in range(61, 121):
        done = core.step(restored, state, struck(cycle), PositioningState())
        state = done.state
        called += [alarm.name for alarm in done.changed if alarm.active]
    assert "BatchShift" not in called
    back = core.migrate_state(replace(design, model=in_place_of(guessed, design.model)), state, 99 * SECOND)
    assert back.tracker.bank.size == 0, "what is learned by a guess is no use to the model before either"


def test_another_model_is_an_expected_change_of_one_cycle(design: CellDesign, learned: CellState) -> None:
    plant = replace(design.model.plant, stiffness_n_per_m=6.6e5)
    other = replace(design, model=replace(design.model, plant=plant))
    changed = core.migrate_state(other, learned, 99 * SECOND)
    assert changed.model_changed
    assert changed.gap.count == 0
    assert changed.tracker is learned.tracker
    done = core.step(other, changed, capture(LEARNED + 1), PositioningState())
    assert not done.state.model_changed
    assert done.state.alarms.alarm("BatchShift").suppressed
    assert core.migrate_state(other, done.state, 99 * SECOND) is done.state
    # two changes between two cycles are one
    assert core.migrate_state(design, changed, 99 * SECOND).model_changed
    # a state that does not know by what model it was learned is not taken for another's
    assert not core.migrate_state(other, replace(learned, model_digest=""), 99 * SECOND).model_changed
