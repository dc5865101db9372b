"""The files that a run of the workflow leaves: all of them, or those of the run before."""

from collections.abc import Callable
from pathlib import Path

from impactcell.errors import CampaignError
from impactcell.process.whole_files import directory_beside

FILES = ("result.json", "model.extended.yaml", "report.html")
"""What a run leaves in its directory."""
MORE_FILES = ("law_of_*", "report.*.html")
"""And the report in further languages, and where a law that nobody had listed is proposed, its effect file,
or the base model with it."""


def write_files(output: Path, write: Callable[[Path], None]) -> None:
    """Have all files written beside the directory and move them in together at the end.

    Raises
    ------
    CampaignError
        The directory cannot be written.
    """
    try:
        with directory_beside(output) as beside:
            write(beside)
            output.mkdir(exist_ok=True)
            for stale in [file for pattern in MORE_FILES for file in output.glob(pattern)]:
                stale.unlink()
            more = [file for pattern in MORE_FILES for file in beside.glob(pattern)]
            for file in [*more, *(beside / name for name in FILES)]:
                file.replace(output / file.name)
    except OSError as error:
        raise CampaignError(f"{output}: cannot be written: {error.strerror}") from error
