"""The service manager's protocol: readiness, watchdog and stopping, as in sd_notify(3)."""

import asyncio
import logging
import os
import socket

from impactcell.errors import SettingsError

log = logging.getLogger(__name__)


def notify(state: str) -> bool:
    """Send `state`, as in `READY=1`, to the service manager; False where there is none.

    Raises
    ------
    SettingsError
        `NOTIFY_SOCKET` is no address of a socket.
    """
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return False
    if address[0] not in "/@":
        raise SettingsError(f"NOTIFY_SOCKET={address}: neither a path nor an abstract socket")
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as channel:
            channel.connect("\0" + address[1:] if address[0] == "@" else address)
            channel.sendall(state.encode())
    except OSError as error:
        log.warning("the service manager at NOTIFY_SOCKET=%s cannot be told %s: %s", address, state, error)
        return False
    return True


def watchdog_interval_s() -> float | None:
    """Half the time after which the service manager takes a silent service for dead; None without one."""
    microseconds = os.environ.get("WATCHDOG_USEC", "")
    for_us = os.environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
    return int(microseconds) / 2e6 if microseconds.isdigit() and int(microseconds) > 0 and for_us else None


async def keep_watchdog_quiet() -> None:
    """Tell the service manager, where it wants to know, that the event loop is alive; until cancelled."""
    interval_s = watchdog_interval_s()
    while interval_s is not None:
        notify("WATCHDOG=1")
        await asyncio.sleep(interval_s)
