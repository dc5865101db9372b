"""Reads a measurement file of any kind into tables."""

from collections.abc import Callable
from pathlib import Path

from impactcell.errors import MeasurementError
from impactcell.measurements.dialect import Dialect
from impactcell.measurements.limits import Limits
from impactcell.measurements.table import Table
from impactcell.measurements.text_file import read_text

Reader = Callable[[Path, Limits], tuple[Table, ...]]
TEXT_SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn", ".log", "")
"""Endings of files that are read as text."""


def read_tables(
    path: Path, limits: Limits | None = None, dialect: Dialect | None = None
) -> tuple[Table, ...]:
    """Read the tables of a measurement file: text in any dialect.

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
        return read_text(path, limits, dialect or Dialect())
    except OSError as error:
        raise MeasurementError(f"{path}: cannot be read: {error.strerror}") from error
