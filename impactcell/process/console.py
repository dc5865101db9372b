"""What a verb says beside its result; `-q` silences it."""

import logging
import sys

_log = logging.getLogger("impactcell")


def print_result(text: str) -> None:
    """Say on standard output what was done; nothing with `-q`.

    What a verb is asked for (rows, a list, JSON) is its result and is written whatever the options.
    """
    if not is_quiet():
        sys.stdout.write(f"{text}\n")


def print_note(text: str) -> None:
    """Say on standard error what a reader of the result should know; nothing with `-q`."""
    if _log.isEnabledFor(logging.WARNING):
        sys.stderr.write(f"{text}\n")


def is_quiet() -> bool:
    """Whether `-q` was given."""
    return not _log.isEnabledFor(logging.INFO)
