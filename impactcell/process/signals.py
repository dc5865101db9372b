"""How a program that runs on is asked to end."""

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterator

from impactcell.process.exit_codes import ExitCode


def ends_of_terminal() -> tuple[signal.Signals, ...]:
    """Signals by which a program ends with its terminal; none where nohup keeps it running."""
    return () if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else (signal.SIGHUP,)


@contextlib.contextmanager
def stop_on_signals(stop: asyncio.Event, *others: signal.Signals) -> Iterator[list[signal.Signals]]:
    """Set `stop` on SIGTERM, Ctrl-C and `others` meanwhile; yields what came, SIGINT being Ctrl-C."""
    loop = asyncio.get_running_loop()
    received: list[signal.Signals] = []

    def end(number: signal.Signals) -> None:
        received.append(number)
        stop.set()

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT, *others)}
    for number in before:
        loop.add_signal_handler(number, end, number)
    try:
        yield received
    finally:
        for number, handler in before.items():
            loop.remove_signal_handler(number)
            signal.signal(number, handler)


@contextlib.contextmanager
def told_when_ended(say: Callable[[], object]) -> Iterator[None]:
    """Have SIGTERM and Ctrl-C end the program inside, with the exit code of each; `say` says so.

    For what comes before any event loop runs, and has opened nothing. A KeyboardInterrupt would not do: where
    one passes through a library's own start, Python ends as killed by the signal, whoever catches it.
    """
    codes = {signal.SIGTERM: ExitCode.DONE, signal.SIGINT: ExitCode.INTERRUPTED}
    before = {number: signal.getsignal(number) for number in codes}
    for number in codes:
        if before[number] is not signal.SIG_IGN:
            signal.signal(number, lambda number, _: sys.exit(codes[signal.Signals(number)]))
    try:
        yield
    except SystemExit:
        say()
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def stop_on_end_of_input(stop: asyncio.Event) -> Iterator[None]:
    """Set `stop` when standard input ends meanwhile, as a pipe does with the process at its other end."""
    loop = asyncio.get_running_loop()
    descriptor = sys.stdin.fileno()

    def look() -> None:
        if not os.read(descriptor, 4096):
            loop.remove_reader(descriptor)
            stop.set()

    loop.add_reader(descriptor, look)
    try:
        yield
    finally:
        loop.remove_reader(descriptor)
