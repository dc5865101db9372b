"""A service and a module that are started anew: the journal goes on, nothing twice, nothing blocked."""

from pathlib import Path

import pytest

from impactcell.journal.store import Journal
from tests.integration.processes import write_cell
from tests.integration.stepped import stepped
from tests.integration.watched import serving

pytestmark = pytest.mark.slow


def stored(directory: Path) -> list[tuple[int, int]]:
    with Journal(directory / "press-1.sqlite", "press-1", read_only=True) as journal:
        return [(capture.session, capture.cycle) for capture in journal.captures()]


async def test_service_and_module_start_anew(tmp_path: Path) -> None:
    async with stepped(deviations=[]) as module:
        path = write_cell(tmp_path, module.port)
        async with serving(path) as first:
            await first.connected("press-1")
            module.strike(4)
            await first.until("press-1", 4)
        module.strike(2)
        async with serving(path) as second:
            await second.connected("press-1")
            module.strike(2)
            shown = await second.until("press-1", 4)
            assert second.service.running["press-1"].worker.journal_fault == ""
        before = stored(tmp_path)
        assert [cycle for _, cycle in before] == list(range(1, 9))
        assert len({session for session, _ in before}) == 1
        assert before[0][0] != 0
        assert shown[0].cycle == 5
        module.restart()
        async with serving(path) as third:
            await third.connected("press-1")
            module.strike(4)
            await third.until("press-1", 4)
            assert third.service.running["press-1"].worker.journal_fault == ""
    after = stored(tmp_path)
    assert after[: len(before)] == before
    assert [cycle for _, cycle in after[len(before) :]] == [1, 2, 3, 4]
    assert len({session for session, _ in after}) == 2


async def test_what_can_be_reloaded_is_and_the_rest_stays(tmp_path: Path) -> None:
    async with stepped(deviations=[]) as module:
        path = write_cell(tmp_path, module.port)
        async with serving(path) as watched:
            await watched.connected("press-1")
            module.strike(2)
            await watched.until("press-1", 2)
            changed = path.read_text().replace("wear_limit: 0.25", "wear_limit: 0.3")
            path.write_text(changed.replace("cell: press-1", "cell: other") + "signature: {points: 20}\n")
            await watched.service.reload()
            module.strike()
            snapshot = (await watched.until("press-1", 3))[-1]
            assert snapshot.wear.limit == 0.3
            assert len(snapshot.signature.position_m) == 20
            path.write_text("format: 1\n")
            await watched.service.reload()
            module.strike(2)
            await watched.until("press-1", 5)
    assert "other" not in watched.snapshots


async def test_a_second_service_is_kept_from_the_journal(tmp_path: Path) -> None:
    from impactcell.errors import JournalError

    path = tmp_path / "j"
    with Journal(path, "c"), pytest.raises(JournalError, match="another service"):
        Journal(path, "c")
    Journal(path, "c").close()
