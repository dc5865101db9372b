"""What ends a demo while no event loop of it runs: it is set up, or put away."""

import contextlib
import signal
from collections.abc import Iterator

from impactcell.process.signals import ends_of_terminal


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Have SIGTERM and the end of the terminal raise SystemExit inside, so that all is put away."""
    ends = (signal.SIGTERM, *ends_of_terminal())
    for end in ends:
        signal.signal(end, _end)
    try:
        yield
    finally:
        for end in ends:
            signal.signal(end, signal.SIG_DFL)


def end_once() -> None:
    """Have a second signal not stop what is put away: a shell and its terminal both say that they end."""
    for end in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(end, signal.SIG_IGN)


def _end(*_: object) -> None:
    end_once()
    raise SystemExit(0)
