"""How large a measurement file may be: what is beyond is refused before it is read."""

import os
from dataclasses import dataclass
from pathlib import Path

from impactcell.errors import MeasurementError


@dataclass(frozen=True, slots=True)
class Limits:
    """Largest sizes that are read.

    Attributes
    ----------
    file_bytes : int
        Of one file; 500 MB are an hour of three channels at 10 kHz as text.
    rows, columns : int
        Of one table.
    cells : int
        Rows times columns, over all tables of a file: 8 bytes each once they are read.
    files : int
        Files of one import, or members of an archive.
    unpacked_bytes : int
        All members of an archive together.
    """

    file_bytes: int = 500_000_000
    rows: int = 20_000_000
    columns: int = 1000
    cells: int = 60_000_000
    files: int = 5000
    unpacked_bytes: int = 1_000_000_000

    def check_file(self, path: Path) -> int:
        """Give the size of a file that may be read.

        Raises
        ------
        MeasurementError
            It is missing, no file, empty or too large.
        """
        try:
            status = os.stat(path)  # noqa: PTH116 - one look only
        except OSError as error:
            raise MeasurementError(f"{path}: cannot be read: {error.strerror}") from error
        if not path.is_file():
            raise MeasurementError(f"{path}: is not a file; name the measurement files themselves")
        if status.st_size > self.file_bytes:
            raise MeasurementError(
                f"{path}: has {status.st_size / 1e6:.0f} MB, more than the {self.file_bytes / 1e6:.0f} MB "
                f"that "
                f"are read; export the stretch or the channels that are needed"
            )
        if status.st_size == 0:
            raise MeasurementError(f"{path}: is empty; leave the file out, or record it again")
        return status.st_size

    def check_shape(self, place: str, rows: int, columns: int, cells_before: int = 0) -> int:
        """Give the cells of a file once a table of this shape has been read of it.

        Raises
        ------
        MeasurementError
            There are too many rows, columns or cells.
        """
        if columns > self.columns:
            raise MeasurementError(
                f"{place}: has {columns} columns, more than the {self.columns} that are read; export those "
                f"that are needed"
            )
        if rows > self.rows:
            raise MeasurementError(f"{place}: has {rows} rows, more than the {self.rows} that are read")
        cells = cells_before + rows * columns
        if cells > self.cells:
            raise MeasurementError(
                f"{place}: has {cells} cells, more than the {self.cells} that are read; export the channels "
                f"that are needed"
            )
        return cells
