"""Libraries that read files, some of them installed apart."""

import contextlib
import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from impactcell.errors import MeasurementError
from impactcell.process.extras import how_to_install


def reader_library(module: str, kind: str, path: Path) -> Any:
    """Give the library that reads a kind of file.

    Raises
    ------
    MeasurementError
        It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MeasurementError(
            f"{path}: {kind} files are read with {module.partition('.')[0]}, which is not installed; run "
            f"{how_to_install('import')}, or export the file as CSV"
        ) from error


@contextlib.contextmanager
def damage_told(path: Path, kind: str) -> Iterator[None]:
    """Tell whatever the library that reads a file raises as damage to the file; libraries raise anything.

    Raises
    ------
    MeasurementError
        Something was raised.
    """
    try:
        yield
    except MeasurementError:
        raise
    except Exception as error:
        raise MeasurementError(f"{path}: is a damaged {kind} file: {error}") from error
