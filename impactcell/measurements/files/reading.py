"""Reads a measurement file of any kind into tables; the kind is told from its first bytes."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from impactcell.errors import MeasurementError
from impactcell.measurements.files.dialect import Dialect
from impactcell.measurements.files.hdf5 import read_hdf5
from impactcell.measurements.files.json_file import read_json
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.files.matlab import read_matlab
from impactcell.measurements.files.mdf4 import read_mdf4
from impactcell.measurements.files.parquet import read_parquet
from impactcell.measurements.files.tdms import read_tdms
from impactcell.measurements.files.text_file import read_text
from impactcell.measurements.files.unpacking import ARCHIVES, unpacked
from impactcell.measurements.notation.natural_order import natural_key
from impactcell.measurements.table import Table

Reader = Callable[[Path, Limits], tuple[Table, ...]]
KINDS: tuple[tuple[bytes, Reader, str], ...] = (
    (b"PAR1", read_parquet, "metadata of the schema, velocity = '3000 mm/min'"),
    (b"\x89HDF\r\n\x1a\n", read_hdf5, "an attribute of its group or of the file, velocity = '3000 mm/min'"),
    (b"MATLAB 7.3", read_hdf5, "a scalar, velocity_mm_min = 3000"),
    (b"MATLAB", read_matlab, "a scalar, velocity_mm_min = 3000"),
    (b"TDSm", read_tdms, "a property of its group or of the file, velocity = '3000 mm/min'"),
    (b"MDF ", read_mdf4, "a channel, velocity in mm/min"),
)
"""First bytes of a file, what reads it, and how it says what is constant."""


def read_tables(
    path: Path, limits: Limits | None = None, dialect: Dialect | None = None
) -> tuple[Table, ...]:
    """Read the tables of a measurement file: text, Parquet, HDF5, MDF, TDMS, MATLAB, JSON, or a zip.

    Parameters
    ----------
    path : Path
    limits : Limits, optional
        What is larger is refused before it is read.
    dialect : Dialect, optional
        How a text file separates its cells, where it is not to be told from the file.

    Returns
    -------
    tuple of Table
        One of a text file; one a group of those that have groups.

    Raises
    ------
    MeasurementError
        What is wrong, by file and line or column, and the way out.
    """
    limits = limits or Limits()
    limits.check_file(path)
    try:
        with path.open("rb") as file:
            head = file.read(16)
        if head.startswith(ARCHIVES):
            return _packed(path, limits, dialect)
        for begin, reader, constant_as in KINDS:
            if head.startswith(begin):
                return tuple(replace(table, constant_as=constant_as) for table in reader(path, limits))
        if path.suffix.lower() == ".mat":
            return read_matlab(path, limits)
        if path.suffix.lower() == ".json":
            return read_json(path, limits)
        return read_text(path, limits, dialect or Dialect())
    except OSError as error:
        raise MeasurementError(f"{path}: cannot be read: {error.strerror}") from error


def _packed(path: Path, limits: Limits, dialect: Dialect | None) -> tuple[Table, ...]:
    """Read the tables of all files of an archive, which has no archive within."""
    tables: list[Table] = []
    with unpacked(path, limits) as directory:
        for file in sorted(directory.rglob("*"), key=lambda file: natural_key(str(file))):
            if not file.is_file():
                continue
            with file.open("rb") as opened:
                if opened.read(4).startswith(ARCHIVES):
                    raise MeasurementError(f"{path}: holds an archive, {file.name!r}; unpack it first")
            source = f"{path}/{file.relative_to(directory)}"
            try:
                tables += (replace(table, source=source) for table in read_tables(file, limits, dialect))
            except MeasurementError as error:
                raise MeasurementError(str(error).replace(str(file), source)) from error
    if not tables:
        raise MeasurementError(f"{path}: holds no files")
    return tuple(tables)
