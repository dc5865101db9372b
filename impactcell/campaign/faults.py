"""Collects every fault of a campaign before any of them is reported."""

import contextlib
import stat
from collections.abc import Iterator
from pathlib import Path

from impactcell.errors import CampaignError

LARGEST = 1e30
"""Beyond it, in SI units, is no measurement: squares of what is far larger have no double."""
MOST_BYTES = 500_000_000
"""Of one file: an hour of three channels at 10 kHz as text."""
MAX_FAULTS_SHOWN = 20
"""Faults told of one campaign; a reader mends twenty at a time."""


@contextlib.contextmanager
def naming(source: Path | None) -> Iterator[None]:
    """Put where a campaign was read before what is found wrong with it later; None for one never read."""
    try:
        yield
    except CampaignError as error:
        if source is None:
            raise
        raise CampaignError(f"{source}: {error}") from error


class Faults:
    """List of `file:line: what is wrong; the way out`, raised together."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._messages: list[str] = []

    def add(self, file: Path, line: int | None, message: str) -> None:
        """Note one fault; `line` counts from 1 and is None where the whole file is meant."""
        place = str(file) if line is None else f"{file}:{line}"
        self._messages.append(f"{place}: {message}")

    def raise_any(self) -> None:
        """Raise what was noted.

        Raises
        ------
        CampaignError
            With one fault a line, when there is any.
        """
        if not self._messages:
            return
        shown = self._messages[:MAX_FAULTS_SHOWN]
        rest = len(self._messages) - len(shown)
        if rest:
            shown.append(f"{self._directory}: and {rest} more faults")
        raise CampaignError("\n".join(shown))

    def __len__(self) -> int:
        return len(self._messages)


def read_text(file: Path, faults: Faults, if_missing: str) -> str | None:
    """Text of `file`, or None after noting why it cannot be read; `if_missing` is the way out of that."""
    try:
        status = file.stat()
        if not stat.S_ISREG(status.st_mode):
            faults.add(file, None, "is not a file; put the data themselves there")
        elif status.st_size > MOST_BYTES:
            faults.add(file, None, f"has more than the {MOST_BYTES / 1e6:.0f} MB that are read; divide it")
        else:
            return file.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        faults.add(file, None, f"is missing; {if_missing}")
    except UnicodeDecodeError as error:
        faults.add(file, None, f"is not UTF-8 text (byte {error.start}); write it again as UTF-8")
    except OSError as error:
        faults.add(file, None, f"cannot be read: {error.strerror}")
    return None
