"""The journals of earlier versions that lie here, and what these read in them; see README.md."""

import json
import lzma
from pathlib import Path
from typing import Any

from impactcell.journal.stored_forms import STATE

DATA = Path(__file__).parent
FORMATS = range(3, STATE.format + (DATA / f"journal-format-{STATE.format}.sqlite.xz").exists())
"""Of the state: of each that an earlier version wrote there is a journal, the first without a number."""


def copy_journal(number: int, path: Path) -> Path:
    """Write the journal of a format to a file of its own."""
    path.write_bytes(_content(f"journal-format-{number}.sqlite"))
    return path


def what_was_read(number: int) -> dict[str, Any]:
    """Give what the version that wrote the journal of a format read in it."""
    read: dict[str, Any] = json.loads(_content(f"journal-format-{number}.json"))
    return read


def _content(name: str) -> bytes:
    packed = DATA / f"{name}.xz"
    return lzma.decompress(packed.read_bytes()) if packed.exists() else (DATA / name).read_bytes()
