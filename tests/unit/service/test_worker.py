"""A worker stores what can be stored, in order, and survives what nobody foresaw."""

import asyncio
import contextlib
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from impactcell import cell as core
from impactcell.alarms import AlarmEvent, EventKind, Message, RuleResult
from impactcell.alarms.rules import module_connection
from impactcell.errors import ForeignJournalError, JournalFullError
from impactcell.fieldbus.cycles.taken_cycles import TakenBefore
from impactcell.journal.audit_entries import AuditEntry
from impactcell.journal.history import HistoryQuery
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.prediction import PROVISIONAL
from impactcell.records import Alarm, Capture, Channel, CycleId, PositioningState, Quality, Shelving
from impactcell.serialization.message_pack import pack_tree, unpack_tree
from impactcell.service.factory import cell_design
from impactcell.service.journal_writer import JournalWriter
from impactcell.service.worker import CellWorker
from impactcell.settings import read_cell
from tests.integration.processes import CONFIG
from tests.patience import PATIENCE_S
from tests.snapshots import make_capture


@pytest.fixture(scope="module")
def design() -> core.CellDesign:
    return cell_design(read_cell(CONFIG / "cells" / "prototype.yaml"))


def cycles(path: Path) -> list[int]:
    with Journal(path, None, read_only=True) as journal:
        return [capture.cycle for capture in journal.captures()]


async def process(worker: CellWorker, capture: Capture) -> CycleId | None:
    await worker.process(capture, PositioningState(), None)
    return worker.durable


async def test_an_entry_that_can_never_be_stored_blocks_nothing(
    tmp_path: Path, design: core.CellDesign
) -> None:
    worker = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    assert await process(worker, make_capture(1)) == CycleId(1, 1)
    assert await process(worker, make_capture(1)) == CycleId(1, 1)
    assert "stored already" in worker.journal_fault
    assert await process(worker, replace(make_capture(2), time_ns=2**63)) == CycleId(1, 1)
    assert await process(worker, make_capture(3)) == CycleId(1, 3)
    assert (worker.journal_fault, worker.lost) == ("", 1)
    await worker.close()
    assert cycles(tmp_path / "j") == [1, 3]


async def test_what_was_taken_before_is_known_after_a_restart(
    tmp_path: Path, design: core.CellDesign
) -> None:
    """The last cycle of each session, in the order in which they were left, and which module made it."""
    worker = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    assert await worker.taken_before() == TakenBefore([], "")
    for number, (session, cycle) in enumerate([(7, 1), (7, 2), (99, 1), (3, 8), (99, 2)]):
        capture = replace(make_capture(cycle, session=session), time_ns=10**18 + number)
        await process(worker, capture)
        await worker.note_serial_number("SN1" if session == 7 else "SN2")
    await worker.close()
    worker = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    before = await worker.taken_before()
    await worker.close()
    lives = [(CycleId(7, 2), 10**18 + 1), (CycleId(3, 8), 10**18 + 3), (CycleId(99, 2), 10**18 + 4)]
    assert before == TakenBefore(lives, "SN2")
    with Journal(tmp_path / "j", "c") as journal:
        assert journal.cell == "c"


async def test_no_cycle_waits_for_the_journal_to_be_tidied(
    tmp_path: Path, design: core.CellDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impactcell.service.journal_writer.CHECKPOINT_EVERY", 2)
    journal = Journal(tmp_path / "j", "c")
    worker = CellWorker(design, journal, Retention())
    shown, done = threading.Event(), []

    def late(name: str) -> Callable[..., None]:
        def work(*_: object) -> None:
            assert shown.wait(PATIENCE_S)
            done.append(name)

        return work

    monkeypatch.setattr(journal, "prune", late("prune"))
    monkeypatch.setattr(journal, "checkpoint", late("checkpoint"))
    for cycle in range(1, 6):
        shown.clear()
        assert await process(worker, make_capture(cycle)) == CycleId(1, cycle)
        shown.set()
        await worker.run(lambda: None)
    await worker.close()
    assert done == ["prune", "checkpoint", "checkpoint"]


@pytest.mark.parametrize(
    ("module_ns", "looked_ns"), [(0, 10**18), (10**18 - 5, 10**18 - 5), (10**18 + 5, 10**18)]
)
def test_what_is_kept_follows_the_module_unless_it_has_no_time_or_runs_ahead(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module_ns: int, looked_ns: int
) -> None:
    monkeypatch.setattr("impactcell.service.journal_writer.time.time_ns", lambda: 10**18)
    looks: list[int] = []
    with Journal(tmp_path / "j", "c") as journal:
        monkeypatch.setattr(journal, "prune", lambda _, now_ns, __: looks.append(now_ns))
        JournalWriter("c", journal, Retention()).maintain(module_ns)
    assert looks == [looked_ns]


async def test_what_is_too_much_to_drop_at_once_goes_in_the_next_looks(
    tmp_path: Path, design: core.CellDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impactcell.service.journal_writer.CHECKPOINT_EVERY", 1)
    journal = Journal(tmp_path / "j", "c")
    worker = CellWorker(design, journal, Retention())
    more, looks = [False, True, True], []

    def prune(*_: object) -> bool:
        looks.append(len(more))
        return more.pop()

    monkeypatch.setattr(journal, "prune", prune)
    for cycle in range(1, 7):
        await process(worker, make_capture(cycle))
    await worker.close()
    assert looks == [3, 2, 1]


async def test_what_cannot_be_stored_now_is_stored_later_in_order(
    tmp_path: Path, design: core.CellDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = Journal(tmp_path / "j", "c")
    worker = CellWorker(design, journal, Retention())

    def full(*_: object) -> None:
        raise JournalFullError("the disk is full")

    with monkeypatch.context() as broken:
        broken.setattr(journal, "append", full)
        for cycle in (1, 2, 3):
            assert await process(worker, make_capture(cycle)) is None
        assert worker.journal_fault == "the disk is full"
    await worker.retry()
    assert worker.journal_fault == ""
    assert worker.durable == CycleId(1, 3)
    await worker.close()
    assert cycles(tmp_path / "j") == [1, 2, 3]


async def test_cycles_that_are_lost_for_a_full_disk_are_counted(
    tmp_path: Path, design: core.CellDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A later cycle will be acknowledged, and that tells the module that the lost ones are stored too."""
    monkeypatch.setattr("impactcell.service.journal_writer.BACKLOG", 4)
    journal = Journal(tmp_path / "j", "c")
    worker = CellWorker(design, journal, Retention())

    def full(*_: object) -> None:
        raise JournalFullError("the disk is full")

    with monkeypatch.context() as broken:
        broken.setattr(journal, "append", full)
        for cycle in range(1, 8):
            assert await process(worker, make_capture(cycle)) is None
            assert worker.lost == max(0, cycle - 4)
    await worker.retry()
    assert (worker.durable, worker.lost) == (CycleId(1, 7), 3)
    await worker.close()
    assert cycles(tmp_path / "j") == [4, 5, 6, 7]


async def test_a_capture_that_cannot_be_computed_counts_as_unreadable(
    design: core.CellDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    worker = CellWorker(design, None, Retention())
    step = core.step

    def fails_with_samples(
        design: core.CellDesign, state: core.CellState, capture: Capture, *rest: Any, **more: Any
    ) -> object:
        if capture.force is not None:
            raise np.linalg.LinAlgError("singular")
        return step(design, state, capture, *rest, **more)

    monkeypatch.setattr(core, "step", fails_with_samples)
    processed = await worker.process(make_capture(1), PositioningState(), None)
    assert processed.snapshot.cycle == 1
    assert processed.snapshot.friction.mu_s.quality is Quality.BAD
    assert worker.last == CycleId(1, 1)
    await worker.close()


async def test_odd_captures_are_survived(design: core.CellDesign) -> None:
    worker = CellWorker(design, None, Retention())
    good = make_capture(1)
    force = good.force
    assert force is not None
    for cycle, odd in enumerate(
        [
            replace(good, position=Channel(np.zeros(200), np.zeros(200))),
            replace(good, force=Channel(force.time_s[:1], force.values[:1])),
            replace(good, mass_kg=float("nan"), velocity_m_s=float("nan")),
            replace(good, force=replace(force, values=force.values * 1e12)),
        ],
        start=1,
    ):
        processed = await worker.process(replace(odd, cycle=cycle), PositioningState(), None)
        assert processed.snapshot.cycle == cycle
    await worker.close()


async def test_a_signature_on_another_grid_is_learned_anew(
    tmp_path: Path, design: core.CellDesign, caplog: pytest.LogCaptureFixture
) -> None:
    worker = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    await process(worker, make_capture(1))
    finer = replace(design, signature=replace(design.signature, points=50))
    await worker.redesign(finer)
    await process(worker, make_capture(2))
    await worker.close()
    again = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    assert again.durable == CycleId(1, 2)
    assert caplog.text.count("the signature is learned anew") == 2
    await process(again, make_capture(3))
    await again.close()


@pytest.mark.parametrize("restarted", [False, True])
async def test_wear_that_a_provisional_model_told_of_ends_with_it_and_is_in_the_history(
    tmp_path: Path, design: core.CellDesign, *, restarted: bool
) -> None:
    guessed = replace(design.model, provenance={PROVISIONAL: "nothing measured"})
    worker = CellWorker(replace(design, model=guessed), Journal(tmp_path / "j", "c"), Retention())
    worn = RuleResult("WearLimit", holds=True, message=Message("worn", "verschlissen"))
    for _ in range(6):
        await worker.apply_rule_result(worn, 10**18)
    fitted = replace(design, model=core.in_place_of(guessed, design.model))
    if restarted:
        await worker.close()
        worker = CellWorker(fitted, Journal(tmp_path / "j", "c"), Retention())
    else:
        await worker.redesign(fitted)
    (now,) = (alarm for alarm in worker.alarms if alarm.name == "WearLimit")
    await worker.close()
    with Journal(tmp_path / "j", None, read_only=True) as journal:
        history = [alarm for alarm in journal.alarms(HistoryQuery()).entries if alarm.name == "WearLimit"]
    assert [alarm.active for alarm in history] == [True, False]
    assert history[-1].time_ns == now.time_ns > 10**18


async def test_alarms_of_another_version_are_told_and_kept_for_it(
    tmp_path: Path, design: core.CellDesign, caplog: pytest.LogCaptureFixture
) -> None:
    worker = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    await process(worker, make_capture(1))
    await worker.close()
    theirs = {"its": "own", "since": 5}
    with Journal(tmp_path / "j", "c") as journal:
        envelope = unpack_tree(journal.state() or b"")
        envelope["content"]["cell"]["alarms"]["alarms"]["FrictionJump"] = theirs
        journal.record(pack_tree(envelope))
    again = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    assert "the journal has alarms of another version; they are kept: FrictionJump" in caplog.text
    await process(again, make_capture(2))
    await again.close()
    with Journal(tmp_path / "j", "c") as journal:
        kept = unpack_tree(journal.state() or b"")["content"]["cell"]
    assert kept["cycle"] == 2
    assert kept["alarms"]["alarms"]["FrictionJump"] == theirs


async def test_a_state_of_other_fields_is_refused_with_a_message_and_left_as_it_is(
    tmp_path: Path, design: core.CellDesign
) -> None:
    worker = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    await process(worker, make_capture(1))
    await worker.close()
    with Journal(tmp_path / "j", "c") as journal:
        stored = journal.state()
        assert stored is not None
        assert b"deviant_run" in stored
        other = stored.replace(b"deviant_run", b"deviant_fun")
        assert worker.snapshot is not None
        journal.append(make_capture(2), replace(worker.snapshot, cycle=2), other)
    with Journal(tmp_path / "j", "c") as journal:
        with pytest.raises(ForeignJournalError) as told:
            CellWorker(design, journal, Retention())
        assert journal.state() == other
    for words in ("/j: the journal of cell 'prototype'", "holds 'deviant_fun'", "lacks deviant_run"):
        assert words in str(told.value)
    assert cycles(tmp_path / "j") == [1, 2]


async def test_no_more_cells_compute_at_a_time_than_there_are_cores(
    design: core.CellDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    step, lock = core.step, threading.Lock()
    at_work, most = 0, 0
    met = threading.Barrier(3)

    def counted(*arguments: Any, **more: Any) -> core.StepResult:
        nonlocal at_work, most
        with lock:
            at_work += 1
            most = max(most, at_work)
        with contextlib.suppress(threading.BrokenBarrierError):
            met.wait(0.1)  # as long as another could come
        try:
            return step(*arguments, **more)
        finally:
            with lock:
                at_work -= 1

    monkeypatch.setattr("impactcell.service.guarded_step._computing", threading.BoundedSemaphore(2))
    monkeypatch.setattr(core, "step", counted)
    cells = [CellWorker(design, None, Retention()) for _ in range(5)]
    await asyncio.gather(*(process(cell, make_capture(1)) for cell in cells))
    for cell in cells:
        await cell.close()
    assert most <= 2


async def test_shelving_ends_when_its_time_is_over(tmp_path: Path, design: core.CellDesign) -> None:
    worker = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    audit = AuditEntry(10, "anna", "TimedShelve", "{}", "Good")
    shelve = AlarmEvent(EventKind.SHELVE_TIMED, time_ns=10, user="anna", shelve_ns=100)

    def shelving() -> Shelving:
        return next(alarm.shelving for alarm in worker.alarms if alarm.name == "WearLimit")

    await worker.apply_event("WearLimit", shelve, audit)
    await worker.expire_shelving(109)
    assert shelving() is Shelving.TIMED
    await worker.expire_shelving(111)
    assert shelving() is Shelving.UNSHELVED
    await worker.close()


@pytest.mark.parametrize("is_kept", [True, False])
async def test_what_cannot_be_written_changes_nothing(
    tmp_path: Path, design: core.CellDesign, *, is_kept: bool
) -> None:
    """One comment in Latin-1, and the cell took in no cycle any more until the service began anew."""
    worker = CellWorker(design, Journal(tmp_path / "j", "c") if is_kept else None, Retention())
    told: list[tuple[Alarm, ...]] = []
    worker.tell_alarms(told.append)
    before, audit = worker.alarms, AuditEntry(10, "anna", "comment", "{}", "Good")
    half = AlarmEvent(EventKind.COMMENT, time_ns=10, user="anna", comment="gr\udcfc")
    with pytest.raises(UnicodeEncodeError):
        await worker.apply_event("WearLimit", half, audit)
    with pytest.raises(UnicodeEncodeError):
        await worker.change_state(lambda state: core.start_batch(state, "B\udcfc", expected=True), audit)
    lost = module_connection.result("gr\udcfc", connected=False)
    with pytest.raises(UnicodeEncodeError):
        await worker.apply_rule_result(lost, 10)
    await asyncio.sleep(0)
    assert worker.alarms == before
    assert not told
    assert await process(worker, make_capture(1)) == CycleId(1, 1)
    assert worker.journal_fault == ""
    await worker.close()
    if is_kept:
        assert cycles(tmp_path / "j") == [1]


async def test_the_time_between_cycles_is_known_from_the_second_on(
    tmp_path: Path, design: core.CellDesign
) -> None:
    worker = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    periods = []
    for cycle in range(1, 4):
        await process(worker, replace(make_capture(cycle), time_ns=10**18 + cycle * 1_500_000_000))
        periods.append(worker.period_s)
    await worker.close()
    assert periods == [0.0, pytest.approx(1.5), pytest.approx(1.5)]
