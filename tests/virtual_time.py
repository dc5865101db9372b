"""Event loops whose clocks are turned on while nothing is left to do: waiting costs little or no time."""

import asyncio
import os
import selectors
import socket
import time
import tty
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class _Selector(selectors.SelectSelector):
    """Turns the clock on instead of waiting, once nothing has come for `grace_s` of real time."""

    now_s = 0.0

    def __init__(self, grace_s: float) -> None:
        super().__init__()
        self._grace_s = grace_s

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0.0)
        if not ready and timeout != 0.0 and self._grace_s:
            ready = super().select(self._grace_s)
        if not ready and timeout:
            self.now_s += timeout
        return ready


class VirtualLoop(asyncio.SelectorEventLoop):
    """Its `time()` begins at 0 s.

    `grace_s`: what goes through the system, such as the bytes of a pseudo terminal, takes that long at most.
    """

    def __init__(self, grace_s: float = 0.0) -> None:
        self._virtual = _Selector(grace_s)
        super().__init__(self._virtual)

    def time(self) -> float:
        return self._virtual.now_s


class _Echo:
    """A pseudo terminal and a pair of sockets of our own, by which is seen that the kernel has kept up.

    Bytes between the ends of a pseudo terminal are carried by a thread of the kernel, which waits for its
    turn as others do: what went before has arrived when a byte that was sent later has.
    """

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self._near, self._far = socket.socketpair()

    def wait(self) -> None:
        """Return when what was on its way before the call has arrived."""
        for _ in range(2):
            for there, back in ((self._master, self._slave), (self._slave, self._master)):
                os.write(there, b"?")
                os.read(back, 1)
            self._near.send(b"?")
            self._far.recv(1)

    def close(self) -> None:
        for end in (self._master, self._slave):
            os.close(end)
        for each in (self._near, self._far):
            each.close()


class _HastySelector(selectors.DefaultSelector):
    """Lets time pass quickly, but only while nothing comes."""

    HASTE = 40.0
    """Seconds of the loop in a second in which nothing comes: a timeout of 10 s is a quarter of a second's
    silence, so that no reply that is on its way between two sockets of this process is ever given up."""
    TIMEOUT_S, SILENCE_S = 1.0, 0.25
    """A timer that is at least so long is the limit of an answer, and takes at least so much real silence:
    a thread of this process may have it in hand."""
    skipped_s = 0.0

    def __init__(self) -> None:
        super().__init__()
        self._echo = _Echo()

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if not timeout or timeout < 0.0:
            return super().select(timeout)
        least_s = self.SILENCE_S if timeout >= self.TIMEOUT_S else 0.0
        ready = super().select(max(timeout / self.HASTE, least_s))
        if not ready:
            self._echo.wait()
            ready = super().select(0.0)
        if not ready:
            self.skipped_s += timeout
        return ready

    def close(self) -> None:
        super().close()
        self._echo.close()


class HastyLoop(asyncio.SelectorEventLoop):
    """Its `time()` is what this thread has worked, and jumps on while there is nothing to do.

    For clients and servers in one process: who waits for a timer alone does not wait long, and however long
    a busy machine lets this process wait for its turn, no time has passed.
    """

    def __init__(self) -> None:
        self._hasty = _HastySelector()
        super().__init__(self._hasty)

    def time(self) -> float:
        return time.thread_time() + self._hasty.skipped_s


def run_virtually(coroutine: Coroutine[Any, Any, T], grace_s: float = 0.0) -> T:
    """Run a coroutine in virtual time; it may not wait for anything outside the process."""
    with asyncio.Runner(loop_factory=lambda: VirtualLoop(grace_s)) as runner:
        return runner.run(coroutine)
