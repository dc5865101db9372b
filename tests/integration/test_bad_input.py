"""What a module can do to a cell: a clear message, a matching quality, and the next good cycle is used."""

import asyncio
import contextlib
import json
import logging
import re
import socket
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest
import yaml

from impactcell.errors import JournalError, SettingsError
from impactcell.journal.store import Journal
from impactcell.records import Quality
from impactcell.scada import Actor, HistoryRequest, RefusedError, Role
from impactcell.service import Service
from impactcell.service.history_source import JournalHistory
from impactcell.service.operator_commands import OperatorCommands
from impactcell.settings import read_cells
from tests.integration.processes import CONFIG, simulator, write_cell
from tests.integration.stepped import stepped
from tests.integration.watched import serving

pytestmark = pytest.mark.slow

KINDS = ["empty", "constant_force", "saturated", "no_separation", "not_a_number", "no_force"]


async def test_captures_of_no_use(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    faulty = [{"cycle": 3 + 2 * i, "kind": kind} for i, kind in enumerate(KINDS)]
    cycles = 3 + 2 * len(KINDS)
    changes: dict[str, Any] = {
        "faulty_captures": faulty,
        "batches": [{"from_cycle": 1, "id": "A"}],
        "deviations": [],
    }
    async with stepped(**changes) as module, serving(write_cell(tmp_path, module.port)) as watched:
        await watched.connected("press-1")
        module.strike(cycles)
        snapshots = await watched.until("press-1", cycles)
    by_cycle = {snapshot.cycle: snapshot for snapshot in snapshots}
    assert sorted(by_cycle) == list(range(1, cycles + 1))
    for entry in faulty:
        bad, after = by_cycle[entry["cycle"]], by_cycle[entry["cycle"] + 1]
        assert after.friction.mu_s.quality is Quality.GOOD, (entry, after.friction)
        assert after.friction.mu_s.value == pytest.approx(0.2, rel=0.1)
        assert bad.friction.mu_s.quality > Quality.GOOD, (entry, bad.friction)
        assert bad.friction.mu_s.reason
    assert not any(record.exc_info for record in caplog.records)
    text = caplog.text
    assert "press-1" in text
    assert "register force (320)" in text


async def test_alarms_are_logged_as_they_come_and_every_cycle_where_asked(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG, "impactcell")
    async with stepped() as module:
        path = write_cell(tmp_path, module.port, alarms={"wear_limit": 0.1})
        async with serving(path) as watched:
            await watched.connected("press-1")
            module.strike(12)
            await watched.until("press-1", 12)
            await watched.alarm("press-1", "WearLimit", active=True)
            module.strike(3)
            await watched.until("press-1", 15)
    lines = [record.getMessage() for record in caplog.records]
    assert sum("alarm WearLimit is active: " in line for line in lines) == 1
    for snapshot in watched.snapshots["press-1"][:15]:
        start = f"cell=press-1 cycle={snapshot.cycle} mu_s {snapshot.friction.mu_s.value:.4f}"
        assert any(line.startswith(start) for line in lines)


async def test_one_sick_cell_leaves_the_other_alone(tmp_path: Path) -> None:
    async with stepped() as module:
        well = write_cell(tmp_path, module.port, "well", module={"window": None})
        absent = write_cell(tmp_path, 1, "absent")
        stranger = write_cell(tmp_path, module.port, "stranger", module={"window": None, "device_id": 9})
        async with serving(well, absent, stranger) as watched:
            await watched.connected("well")
            module.strike(5)
            await watched.until("well", 5)
            assert "127.0.0.1:1" in await watched.alarm("absent", "ModuleConnection", active=True)
            message = await watched.alarm("stranger", "ModuleConnection", active=True)
            assert "device_id 9" in message or "device 9" in message
            module.strike(3)
            await watched.until("well", 8)


async def test_a_foreign_journal_keeps_its_own_cell_out_and_no_other(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "impactcell")
    foreign = b"this is somebody's text file, not a journal\n" * 40
    (tmp_path / "odd.sqlite").write_bytes(foreign)
    monitoring = {"port": 0}
    async with stepped() as module:
        well = write_cell(tmp_path, module.port, "well", monitoring=monitoring)
        odd = write_cell(tmp_path, 1, "odd", monitoring=monitoring)
        async with serving(well, odd) as watched:
            await watched.connected("well")
            module.strike(3)
            await watched.until("well", 3)
            at = re.search(r"metrics at (http://\S+)", caplog.text)
            assert at is not None
            with pytest.raises(urllib.error.HTTPError) as caught:
                await asyncio.to_thread(urllib.request.urlopen, f"{at[1]}/healthz")
            with caught.value as answer:
                assert answer.code == 503
                seen = json.load(answer)
        assert seen["well"] == {"healthy": True, "reason": ""}
        assert seen["odd"]["healthy"] is False
        assert "the journal cannot be opened" in seen["odd"]["reason"]
    assert (tmp_path / "odd.sqlite").read_bytes() == foreign
    assert "cell=odd waits until its journal can be opened" in caplog.text
    assert "odd.sqlite" in caplog.text
    with pytest.raises(JournalError, match=r"odd\.sqlite"):
        async with serving(odd):
            pass


async def test_a_cell_starts_by_itself_once_its_journal_can_be_opened(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.INFO, "impactcell")
    monkeypatch.setattr("impactcell.service.service.AGAIN_S", 0.05)
    obstacle = tmp_path / "press-1.sqlite.lock"
    obstacle.mkdir()
    actor = Actor("anna", Role.ENGINEER, "127.0.0.1")
    async with stepped() as module:
        path = write_cell(tmp_path, module.port, monitoring={"port": 0})
        async with serving(path) as watched:
            at = re.search(r"metrics at (http://\S+)", caplog.text)
            assert at is not None
            await asyncio.sleep(0.3)
            with pytest.raises(urllib.error.HTTPError, match="503") as caught:
                await asyncio.to_thread(urllib.request.urlopen, f"{at[1]}/healthz")
            caught.value.close()
            actions, history = (
                OperatorCommands(watched.service.running),
                JournalHistory(watched.service.running),
            )
            with pytest.raises(RefusedError, match="does not run"):
                await actions.start_batch("press-1", "B", expected=True, actor=actor)
            with pytest.raises(RefusedError, match="cannot be opened"):
                await history.values("press-1", "Friction/StaticFriction", HistoryRequest(None, None, 1))
            obstacle.rmdir()
            await watched.connected("press-1")
            module.strike(3)
            await watched.until("press-1", 3)
            with await asyncio.to_thread(urllib.request.urlopen, f"{at[1]}/healthz") as answer:
                assert json.load(answer) == {"press-1": {"healthy": True, "reason": ""}}
            await actions.start_batch("press-1", "B", expected=True, actor=actor)
            assert (
                await history.values("press-1", "Friction/StaticFriction", HistoryRequest(None, None, 1))
            ).values
            await history.close()
    with Journal(tmp_path / "press-1.sqlite", "press-1") as journal:
        assert journal.count() >= 3
    for said in ("cell=press-1 waits until its journal can be opened", "opened now; the cell runs"):
        assert caplog.text.count(said) == 1, said


async def test_another_map_version_is_refused_by_name(tmp_path: Path) -> None:
    text = (CONFIG / "maps" / "fpga-v1.yaml").read_text()
    newer = tmp_path / "fpga-v2.yaml"
    newer.write_text(text.replace("type: u16, expect: 1", "type: u16, expect: 2"))
    async with stepped() as module:
        cell = write_cell(tmp_path, module.port, module={"register_map": str(newer)})
        async with serving(cell) as watched:
            message = await watched.alarm("press-1", "ModuleConnection", active=True)
    assert "register map_version (16)" in message
    assert "press-1" in message


async def test_a_module_that_goes_and_comes_back(tmp_path: Path) -> None:
    strikes = {"period_s": 0.25}
    path = write_cell(tmp_path, 1)
    async with contextlib.AsyncExitStack() as stack:
        first = contextlib.AsyncExitStack()
        module = await first.enter_async_context(simulator(tmp_path, strikes=strikes))
        path.write_text(path.read_text().replace("port: 1\n", f"port: {module['port']}\n"))
        watched = await stack.enter_async_context(serving(path))
        await watched.until("press-1", 3)
        await watched.alarm("press-1", "ModuleConnection", active=False)
        await first.aclose()
        await watched.alarm("press-1", "ModuleConnection", active=True)
        seen = len(watched.snapshots["press-1"])
        listen = {"port": module["port"]}
        await stack.enter_async_context(simulator(tmp_path, strikes=strikes, listen=listen))
        await watched.alarm("press-1", "ModuleConnection", active=False)
        await watched.until("press-1", seen + 3)


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [
        ("opcua", "endpoint", "opc.tcp://127.0.0.1:{}/"),
        ("web", "endpoint", "http://127.0.0.1:{}"),
        ("monitoring", "port", "{}"),
    ],
)
async def test_a_port_in_use_is_told_with_the_line_that_names_it(
    tmp_path: Path, section: str, key: str, value: str
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        said = yaml.safe_load(value.format(taken.getsockname()[1]))
        path = write_cell(tmp_path, 1, **{section: {key: said}})
        service = Service(read_cells([path]))
        with pytest.raises(SettingsError, match="Address already in use") as caught:
            await service.run(asyncio.Event())
    told = re.fullmatch(
        rf"{re.escape(str(path))}:(\d+):\d+: .*; choose another (.*), or end what uses it", str(caught.value)
    )
    assert told is not None, str(caught.value)
    assert path.read_text().splitlines()[int(told[1]) - 1] == f"  {key}: {said}"
    assert f"`{section}.{key}`" in told[2]
