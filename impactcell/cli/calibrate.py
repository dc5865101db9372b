"""`impactcell calibrate`: equations (4) and (5) fitted to a cell's own plant."""

import math
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from impactcell.cli.paths import check_output
from impactcell.errors import SettingsError
from impactcell.physics import TapInput
from impactcell.physics.local_friction import friction_factor
from impactcell.prediction import Model
from impactcell.prediction import calibrate as fit_predictors
from impactcell.process.console import print_result
from impactcell.process.progress import progress
from impactcell.records import MM_PER_MIN, Samples
from impactcell.settings import CellConfig, read_cell
from impactcell.settings.model_file import write_model

VELOCITIES = 17
"""Velocities swept, evenly from slowest to fastest."""
FRICTIONS = 17
"""Values of mu_s swept, evenly over the span."""
MASSES = 13
"""Masses swept, in equal ratios."""
SLOWEST = 1 / 3
"""Of the cell's fastest tap. Below it stiction decides, which equations (4) and (5) do not describe."""
FRICTION_SPAN = 0.25
"""Friction is swept this far to either side of the plant's, and beyond the wear limit."""
LIGHTEST, HEAVIEST = 0.5, 2.0
"""Masses swept, of the cell's part."""
UNKNOWN_MASSES_KG = (5.0, 50.0)
"""Swept where the cell leaves the mass to the module."""


def calibrate(cell: Path, output: Path) -> None:
    """Sweep friction, velocity and mass for a cell's plant and stroke, fit (4) and (5), write the model.

    The same cell gives the same bytes. Nothing is written before all is done.

    Parameters
    ----------
    cell : Path
        Cell file; its model is the plant that is swept.
    output : Path
        Model file to write.

    Raises
    ------
    SettingsError
        The cell cannot be read or the model not written.
    PredictionError
        The part does not slide free over the range.
    """
    check_output(output, SettingsError)
    cell_config = read_cell(cell)
    write_model(calibrated_model(cell_config), output)
    print_result(f"{output}: model of {cell_config.name}; it is used where a cell file's `model` names it")


def calibrated_model(cell: CellConfig) -> Model:
    """Give the model of a cell, with predictors for its actuator and a range of masses."""
    settings, model = cell.settings, cell.model
    stroke = math.inf if settings.actuator.stroke_mm is None else settings.actuator.stroke_mm * 1e-3
    fastest = settings.actuator.max_velocity_mm_per_min / 60e3
    velocities = np.linspace(SLOWEST * fastest, fastest, VELOCITIES)
    masses = _masses(settings.part.mass_kg)
    tap = TapInput(fastest, float(masses[0]), stroke, halts_at_separation=math.isinf(stroke))
    mu_s = friction_factor(model.plant, tap) * model.plant.mu_s
    lowest = (1.0 - FRICTION_SPAN) * mu_s
    highest = max((1.0 + FRICTION_SPAN) * mu_s, 1.04 * settings.alarms.wear_limit)
    frictions = np.linspace(lowest, highest, FRICTIONS)
    with progress("calibrating", len(masses)) as advance:
        predictors = fit_predictors(
            model.plant, tap, masses.tolist(), velocities, frictions, lambda at, _: advance() if at else None
        )
    swept = (
        f"mu_s {lowest:.4g}-{highest:.4g} ({FRICTIONS} values, mu_k/mu_s {model.ratio:.4g}), "
        f"v {velocities[0] / MM_PER_MIN:.5g}-{velocities[-1] / MM_PER_MIN:.5g} mm/min ({VELOCITIES}), "
        f"m {masses[0]:.4g}-{masses[-1]:.4g} kg ({len(masses)}), "
        + ("the actuator halts at separation" if math.isinf(stroke) else f"stroke {1e3 * stroke:.4g} mm")
    )
    provenance = {
        **{key: text for key, text in model.provenance.items() if key not in {"calibrated by", "swept"}},
        "calibrated by": f"impactcell {version('impactcell')}, cell {settings.cell}",
        "swept": swept,
    }
    return replace(model, predictors=predictors, stroke_m=stroke, provenance=provenance)


def _masses(nominal_kg: float | None) -> Samples:
    """Masses in equal ratios; the cell's own is one of them."""
    if nominal_kg is None:
        return np.geomspace(*UNKNOWN_MASSES_KG, MASSES)
    masses = nominal_kg * np.geomspace(LIGHTEST, HEAVIEST, MASSES)
    masses[MASSES // 2] = nominal_kg
    return masses
