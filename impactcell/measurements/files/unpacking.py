"""Unpacks archives with a limit on what comes out: a bomb is refused before it goes off."""

import gzip
import lzma
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO

from impactcell.errors import MeasurementError
from impactcell.measurements.files.limits import Limits

CHUNK_BYTES = 1 << 20
"""Bytes unpacked at a time."""
ARCHIVES = (b"PK\x03\x04", b"PK\x05\x06", b"\x1f\x8b")
"""Begin of a zip, of an empty zip, and of a gzip file."""
ENCRYPTED = 0x1
"""Flag of a zip's member that is encrypted (APPNOTE.TXT, 4.4.4)."""


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
            if _begins_as_zip(path):
                _unpack_zip(path, directory, limits)
            else:
                with gzip.open(path) as packed:
                    _copy(packed, directory / (path.stem or "data"), path, limits.unpacked_bytes)
        except OSError as error:
            raise MeasurementError(f"{path}: cannot be unpacked: {error.strerror or error}") from error
        except (
            zipfile.BadZipFile,
            zlib.error,
            lzma.LZMAError,
            EOFError,
            ValueError,
            LookupError,
            RuntimeError,
        ) as error:
            raise MeasurementError(f"{path}: cannot be unpacked, it is damaged: {error}") from error
        yield directory


def _begins_as_zip(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(2) == b"PK"


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
        targets: set[Path] = set()
        for member in members:
            inner = PurePosixPath(member.filename.replace("\\", "/"))
            if member.flag_bits & ENCRYPTED:
                raise MeasurementError(f"{path}: {member.filename!r} is encrypted; unpack it yourself")
            if not inner.parts:
                raise MeasurementError(f"{path}: a file in it has no name; pack it again")
            if inner.is_absolute() or ".." in inner.parts or ":" in inner.parts[0]:
                raise MeasurementError(f"{path}: the name {member.filename!r} leads out of the archive")
            if any(part.startswith((".", "__MACOSX")) for part in inner.parts):
                continue
            target = directory.joinpath(*inner.parts)
            if target in targets:
                raise MeasurementError(f"{path}: holds {member.filename!r} twice; pack each file once")
            targets.add(target)
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
