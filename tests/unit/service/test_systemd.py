"""The service manager's protocol, with a socket in the manager's place."""

import os
import socket
from pathlib import Path

import pytest

from impactcell.errors import SettingsError
from impactcell.service import systemd


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
