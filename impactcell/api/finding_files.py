"""The files that a run of the workflow leaves: all of them, or those of the run before."""

from collections.abc import Callable
from pathlib import Path

from impactcell.errors import CampaignError
from impactcell.process.whole_files import directory_beside

LAST = ("result.json", "model.extended.yaml", "report.html")
"""What a run leaves in its directory whatever it finds; it is moved there when all else is there."""


def write_files(output: Path, write: Callable[[Path], None]) -> None:
    """Have all files written beside the directory and move them in together at the end.

    They take the place of files of the same name. All others are left as they are: a law that an earlier run
    proposed may be the effect file of a model by now.

    Raises
    ------
    CampaignError
        The directory cannot be written.
    """
    try:
        with directory_beside(output) as beside:
            write(beside)
            output.mkdir(exist_ok=True)
            more = sorted(file for file in beside.iterdir() if file.name not in LAST)
            for file in [*more, *(beside / name for name in LAST)]:
                file.replace(output / file.name)
    except OSError as error:
        raise CampaignError(f"{output}: cannot be written: {error.strerror}") from error
