"""Readers that are installed apart, with `pip install impactcell[import]`."""

import importlib
from pathlib import Path
from typing import Any

from impactcell.errors import MeasurementError


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
            f"pip install "
            f"'impactcell[import]', or export the file as CSV"
        ) from error
