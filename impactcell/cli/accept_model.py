"""`impactcell model accept`: an extended model into service, without losing what the cell has learned."""

from dataclasses import replace
from pathlib import Path

from impactcell.cli.calibrate import calibrated_model
from impactcell.process.console import print_result
from impactcell.settings import read_cell
from impactcell.settings.model_file import read_model, write_model


def accept_model(cell: Path, extended: Path) -> None:
    """Calibrate an extended model for the cell and put it in the place of the cell's model file.

    The model that it replaces is kept beside it as `<name>.previous.yaml`. A running service sees the new
    file within a second and goes on with it from the next cycle; tracker, alarms and journal stay.

    Raises
    ------
    SettingsError
        A file cannot be read or written.
    PredictionError
        The part would not slide free over the calibrated range.
    """
    cell_config = read_cell(cell)
    model = calibrated_model(replace(cell_config, model=read_model(extended)))
    target = cell_config.settings.model
    previous = target.with_name(f"{target.stem}.previous{target.suffix}")
    previous.write_bytes(target.read_bytes())
    write_model(model, target)
    print_result(
        f"{cell_config.name} runs with model {model.name} from the next cycle on; before: {previous}"
    )
