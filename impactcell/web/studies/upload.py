"""A file on its way to the disk: limits of size, time and room, and nothing left of one that broke off."""

import asyncio
import re
import shutil
import unicodedata
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Final

from starlette.requests import ClientDisconnect, Request

from impactcell.web.requests import RequestRefusedError

MAX_BYTES: Final = 500_000_000
"""Of one file, and of all files of a study together; what `impactcell import` reads at most of one."""
MAX_FILES: Final = 500
"""Files of a study."""
STALLED_S: Final = 30.0
"""An upload of which nothing comes for so long has broken off."""
LONGEST_S: Final = 1800.0
"""Longest time of an upload: 500 MB at 2.2 Mbit/s."""
ROOM_LEFT_BYTES: Final = 500_000_000
"""Has to stay free on the disk: journals are written there too."""
BUFFER_BYTES: Final = 1 << 20
"""Written to the disk at a time, 1 MiB."""
KINDS: Final = frozenset(
    (".csv", ".txt", ".tsv", ".dat", ".asc", ".parquet", ".h5", ".hdf5", ".mf4", ".tdms", ".mat", ".zip")
)
"""Ends of the names of what can be read."""
MAX_NAME: Final = 80
"""Longest name, in characters."""
MAX_STEM_BYTES: Final = 200
"""Longest name without its kind, in UTF-8: a disk takes 255 with all that is written behind it."""


def safe_name(name: str) -> str:
    """Give a name under which a file can lie on any disk and be shown anywhere; letters stay as they are.

    Raises
    ------
    RequestRefusedError
        It is of no kind that can be read.

    >>> safe_name("../../etc/<script>alert(1)</script>.CSV")
    'script_.csv'
    >>> safe_name("Versuch 3 (März).csv")
    'Versuch_3_März_.csv'
    """
    last = re.split(r"[/\\]", name)[-1]
    # Composed: macOS sends a letter and its dots apart, and the dots alone are no letter.
    stem, dot, kind = unicodedata.normalize("NFKC", last).rpartition(".")
    suffix = f".{kind.lower()}"
    if not dot or suffix not in KINDS:
        raise RequestRefusedError(415, "error_kind")
    stem = re.sub(r"[^\w-]+", "_", stem).lstrip("_-")[: MAX_NAME - len(suffix)]
    return (stem.encode()[:MAX_STEM_BYTES].decode(errors="ignore") or "data") + suffix


async def receive(request: Request, target: Path, study_bytes: Callable[[int], int]) -> int:
    """Write the body of a request to a file that appears when it is whole; returns its size.

    Parameters
    ----------
    request : Request
    target : Path
    study_bytes : callable
        Told the bytes of this file, those that are announced or those that have come, gives those of all
        files of the study.

    Raises
    ------
    RequestRefusedError
        It is too large, too slow, empty, or there is no room for it. Nothing is left of it.
    ClientDisconnect
        It broke off. Nothing is left of it.
    """
    announced = request.headers.get("content-length", "")
    announced_bytes = int(announced) if announced.isdigit() else 0

    def count(size: int) -> None:
        if study_bytes(max(size, announced_bytes)) > MAX_BYTES:
            raise RequestRefusedError(413, "error_file_too_large")

    count(0)
    part = target.with_name(f"{target.name}.part")
    try:
        async with asyncio.timeout(LONGEST_S):
            size = await _write(request.stream(), part, count)
        if not size:
            raise RequestRefusedError(400, "error_file_empty")
        part.replace(target)
    except TimeoutError as error:
        raise RequestRefusedError(408, "error_too_slow") from error
    except OSError as error:
        raise RequestRefusedError(507, "error_no_room") from error
    finally:
        part.unlink(missing_ok=True)
    return size


async def _write(stream: AsyncIterator[bytes], part: Path, count: Callable[[int], None]) -> int:
    size = 0
    with part.open("xb") as file:
        buffer = bytearray()
        chunks = aiter(stream)
        while True:
            async with asyncio.timeout(STALLED_S):
                chunk = await anext(chunks, None)
            if chunk is not None:
                size += len(chunk)
                buffer += chunk
                count(size)
            if buffer and (chunk is None or len(buffer) >= BUFFER_BYTES):
                if shutil.disk_usage(part.parent).free < ROOM_LEFT_BYTES + len(buffer):
                    raise RequestRefusedError(507, "error_no_room")
                await asyncio.to_thread(file.write, bytes(buffer))
                buffer.clear()
            if chunk is None:
                return size


__all__ = ["ClientDisconnect", "receive", "safe_name"]
