"""Figures of the source paper and of this project, drawn from this code; one file a topic."""

import importlib
import pkgutil
from pathlib import Path

from impactcell.errors import SettingsError


def draw(directory: Path) -> list[Path]:
    """Draw every figure as PNG and SVG; return the files in the order they were written.

    Raises
    ------
    SettingsError
        The directory cannot be made or written.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        return [
            path
            for topic in pkgutil.iter_modules(__path__)
            for path in importlib.import_module(f"{__name__}.{topic.name}").draw(directory)
        ]
    except OSError as error:
        raise SettingsError(
            f"{directory}: cannot be written ({error.strerror}); choose another directory"
        ) from error
