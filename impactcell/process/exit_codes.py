"""How a command line ends: its exit codes, and which error leads to which."""

import enum
import errno
import sys
from collections.abc import Callable

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


class ExitCode(enum.IntEnum):
    """Exit codes of every command line of this project."""

    DONE = 0
    FAILED = 1
    BAD_INPUT = 2
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
    try:
        return work() or ExitCode.DONE
    except _BAD_INPUT as error:
        sys.stderr.write(f"{error}\n")
        return ExitCode.BAD_INPUT
    except ImpactCellError as error:
        sys.stderr.write(f"{program}: {error}\n")
        return ExitCode.FAILED
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            raise
        sys.stderr.write(f"{program}: {error.filename}: {error.strerror}; name another\n")
        return ExitCode.FAILED
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
