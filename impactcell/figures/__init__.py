"""Figures of the source paper and of this project, drawn from this code; one file a topic."""

import importlib
import pkgutil
from pathlib import Path

from impactcell.errors import SettingsError
from impactcell.process.progress import progress


def draw(directory: Path) -> list[Path]:
    """Draw every figure as PNG and SVG; return the files by name.

    Raises
    ------
    SettingsError
        The directory cannot be made or written.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        files: list[Path] = []
        topics = [module for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_")]
        with progress("drawing", len(topics)) as advance:
            for topic in topics:
                files += importlib.import_module(f"{__name__}.{topic.name}").draw(directory)
                advance()
        return sorted(files)
    except OSError as error:
        raise SettingsError(
            f"{directory}: cannot be written ({error.strerror}); choose another directory"
        ) from error
