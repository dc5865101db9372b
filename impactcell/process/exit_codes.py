"""How a command line ends: its exit codes, and which error leads to which."""

import enum
import errno
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

from impactcell.errors import (
    AccessError,
    CampaignError,
    EffectError,
    ForeignJournalError,
    ImpactCellError,
    MapError,
    MeasurementError,
    SeriesError,
    SettingsError,
    UnstoredError,
)

_BAD_INPUT = (
    AccessError,
    CampaignError,
    EffectError,
    ForeignJournalError,
    MapError,
    MeasurementError,
    SeriesError,
    SettingsError,
)

_UNWRITABLE: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EPIPE)
"""Why what a verb says cannot be written; what it writes into files says so itself, with their names."""


class ExitCode(enum.IntEnum):
    """Exit codes of every command line of this project."""

    DONE = 0
    FAILED = 1
    BAD_INPUT = 2
    LOST = 3
    """The service ended as it was told to, and could not store all that it had."""
    INTERRUPTED = 130
    """As a shell says it of a program that Ctrl-C has ended."""


def exit_code_of(program: str, work: Callable[[], int | None]) -> int:
    """Do the work of a command line; what it raises becomes a message on standard error and an exit code.

    Parameters
    ----------
    program : str
        Who says that it failed.
    work : callable
        Returns an exit code of its own, or None where it is done.
    """
    _open_closed_streams()
    try:
        return _flushed(work) or ExitCode.DONE
    except _BAD_INPUT as error:
        sys.stderr.write(f"{error}\n")
        return ExitCode.BAD_INPUT
    except ImpactCellError as error:
        sys.stderr.write(f"{program}: {error}\n")
        return ExitCode.LOST if isinstance(error, UnstoredError) else ExitCode.FAILED
    except OSError as error:
        if error.filename is None and error.errno in _UNWRITABLE:
            _leave_output()
            if error.errno != errno.EPIPE:  # else who read it wants no more
                sys.stderr.write(f"{program}: the output cannot be written: {error.strerror}\n")
        elif error.errno == errno.ENAMETOOLONG:
            sys.stderr.write(f"{program}: {error.filename}: {error.strerror}; name another\n")
        else:
            raise
        return ExitCode.FAILED
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED


def _open_closed_streams() -> None:
    """Give a program that was started with closed streams (`<&-`) empty ones: Python leaves None there."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            stream = Path(os.devnull).open(mode, encoding="utf-8")  # noqa: SIM115 - open until the end
            setattr(sys, name, stream)


def _flushed(work: Callable[[], int | None]) -> int | None:
    """Do the work and write out what it has said: at the interpreter's end a fault of that is a traceback."""
    try:
        return work()
    finally:
        sys.stdout.flush()


def _leave_output() -> None:
    """Give up what still waits for standard output, which the interpreter's end would try to write again."""
    try:
        sys.stdout.flush()
    except OSError:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
