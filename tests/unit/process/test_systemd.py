"""The service manager's protocol, with a socket in the manager's place, and the unit file."""

import asyncio
import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from impactcell.errors import SettingsError
from impactcell.process import systemd
from impactcell.service.service import Service
from tests.integration.processes import CONFIG


@pytest.mark.parametrize("abstract", [False, True])
def test_state_reaches_the_manager(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, abstract: bool) -> None:
    name = f"@impactcell-test-{os.getpid()}" if abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind("\0" + name[1:] if abstract else name)
        monkeypatch.setenv("NOTIFY_SOCKET", name)
        assert systemd.notify("READY=1")
        assert manager.recv(64) == b"READY=1"


def test_no_manager_no_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    assert not systemd.notify("READY=1")
    monkeypatch.setenv("NOTIFY_SOCKET", "/nowhere/notify")
    assert not systemd.notify("READY=1")
    monkeypatch.setenv("NOTIFY_SOCKET", "tcp:1")
    with pytest.raises(SettingsError, match="NOTIFY_SOCKET"):
        systemd.notify("READY=1")


@pytest.mark.parametrize(
    ("microseconds", "pid", "expected"),
    [
        ("10000000", None, 5.0),
        (None, None, None),
        ("x", None, None),
        ("10000000", "1", None),
        ("0", None, None),
    ],
)
def test_watchdog_interval(
    monkeypatch: pytest.MonkeyPatch, microseconds: str | None, pid: str | None, expected: float | None
) -> None:
    for name, value in (("WATCHDOG_USEC", microseconds), ("WATCHDOG_PID", pid)):
        monkeypatch.delenv(name, raising=False)
        if value is not None:
            monkeypatch.setenv(name, value)
    assert systemd.watchdog_interval_s() == expected


async def test_a_service_says_when_it_is_ready_alive_and_stopping(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "20000000")
        monkeypatch.delenv("WATCHDOG_PID", raising=False)
        service, stop, loop = Service([]), asyncio.Event(), asyncio.get_running_loop()
        running = asyncio.create_task(service.run(stop))
        said = [await loop.sock_recv(manager, 64) for _ in range(2)]
        await service.reload()
        said += [await loop.sock_recv(manager, 64) for _ in range(2)]
        stop.set()
        await running
        said.append(await loop.sock_recv(manager, 64))
    assert said[:2] == [b"READY=1", b"WATCHDOG=1"]
    assert said[2].startswith(b"RELOADING=1\nMONOTONIC_USEC=")
    assert said[3:] == [b"READY=1", b"STOPPING=1"]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
def test_the_unit_file_is_one(tmp_path: Path) -> None:
    unit = (CONFIG / "service" / "impactcell.service").read_text()
    assert "ExecStart=/opt/impactcell/.venv/bin/impactcell run " in unit
    here = tmp_path / "impactcell.service"
    here.write_text(unit.replace("/opt/impactcell/.venv/bin/impactcell", sys.executable))
    done = subprocess.run(["systemd-analyze", "verify", here], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
