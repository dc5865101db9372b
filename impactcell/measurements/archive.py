"""Unpacks archives with a limit on what comes out: a bomb is refused before it goes off."""

import gzip
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO

from impactcell.errors import MeasurementError
from impactcell.measurements.limits import Limits

CHUNK_BYTES = 1 << 20
"""Bytes unpacked at a time."""
ARCHIVES = (b"PK\x03\x04", b"PK\x05\x06", b"\x1f\x8b")
"""Begin of a zip, of an empty zip, and of a gzip file."""


@contextmanager
def unpacked(path: Path, limits: Limits) -> Iterator[Path]:
    """Give a directory that holds what an archive holds, for as long as the context lasts.

    Raises
    ------
    MeasurementError
        It is damaged, holds too much or too many files, or a name leads out of the archive.
    """
    with tempfile.TemporaryDirectory(prefix="impactcell-") as name:
        directory = Path(name)
        try:
            if zipfile.is_zipfile(path):
                _unpack_zip(path, directory, limits)
            else:
                with gzip.open(path) as packed:
                    _copy(packed, directory / (path.stem or "data"), path, limits.unpacked_bytes)
        except (
            zipfile.BadZipFile,
            zlib.error,
            EOFError,
            OSError,
            RuntimeError,
            NotImplementedError,
        ) as error:
            raise MeasurementError(f"{path}: cannot be unpacked: {error}") from error
        yield directory


def _unpack_zip(path: Path, directory: Path, limits: Limits) -> None:
    with zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if not member.is_dir()]
        if any(member.filename == "xl/workbook.xml" for member in members):
            raise MeasurementError(f"{path}: is a workbook; save its sheet as CSV")
        if len(members) > limits.files:
            raise MeasurementError(
                f"{path}: holds {len(members)} files, more than the {limits.files} that are read"
            )
        claimed = sum(member.file_size for member in members)
        if claimed > limits.unpacked_bytes:
            raise MeasurementError(
                f"{path}: would unpack to {claimed / 1e6:.0f} MB, more than the "
                f"{limits.unpacked_bytes / 1e6:.0f} MB "
                f"that are read"
            )
        left = limits.unpacked_bytes
        for member in members:
            inner = PurePosixPath(member.filename.replace("\\", "/"))
            if inner.is_absolute() or ".." in inner.parts or ":" in inner.parts[0]:
                raise MeasurementError(f"{path}: the name {member.filename!r} leads out of the archive")
            if any(part.startswith((".", "__MACOSX")) for part in inner.parts):
                continue
            target = directory.joinpath(*inner.parts)
            target.parent.mkdir(parents=True, exist_ok=True)
            with archive.open(member) as packed:
                left -= _copy(packed, target, path, left)


def _copy(packed: IO[bytes] | gzip.GzipFile, target: Path, path: Path, left: int) -> int:
    """Write what is packed to `target`, and no more than `left` bytes of it."""
    written = 0
    with target.open("wb") as file:
        while chunk := packed.read(CHUNK_BYTES):
            written += len(chunk)
            if written > left:
                file.close()
                shutil.rmtree(target.parent, ignore_errors=True)
                raise MeasurementError(f"{path}: unpacks to more than what is read at most")
            file.write(chunk)
    return written
