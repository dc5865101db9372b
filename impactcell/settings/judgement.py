"""A cell judged as a whole: files that are right each for itself, and do not fit each other."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from impactcell.fieldbus.map_promises import not_promised
from impactcell.fieldbus.map_registers import unknown_names
from impactcell.process import yaml_loader
from impactcell.process.yaml_loader import FilePosition
from impactcell.settings.cells import CellConfig

STROKE_TOLERANCE: Final = 0.01
"""A cell's stroke may differ from its model's by this share: less than a stroke is known to."""
CONSTANT_TOLERANCE: Final = 1e-3
"""A constant of a map may differ from what the cell file says by this share: rounding."""


@dataclass(frozen=True, slots=True)
class CellFinding:
    """Something about a cell as a whole, and where in its file it is said.

    Attributes
    ----------
    is_fault : bool
        The cell cannot do what it is for; else it can, but its user should know.
    """

    path: Path
    position: FilePosition
    message: str
    is_fault: bool

    def __str__(self) -> str:
        return f"{self.path}:{self.position}: {'' if self.is_fault else 'note: '}{self.message}"


@dataclass(frozen=True, slots=True)
class _Remark:
    place: tuple[str, ...]
    message: str
    is_fault: bool = True


def judge_cell(cell: CellConfig) -> list[CellFinding]:
    """Say what of a cell does not fit together, faults first.

    Raises
    ------
    SettingsError
        Its file is not what it was.
    """
    _, positions = yaml_loader.load(cell.path)
    remarks = [*_of_model(cell), *_of_map(cell), *_of_service(cell)]
    findings = [
        CellFinding(cell.path, positions.value(remark.place), remark.message, remark.is_fault)
        for remark in remarks
    ]
    return sorted(findings, key=lambda finding: not finding.is_fault)


def _of_model(cell: CellConfig) -> Iterator[_Remark]:
    settings, model = cell.settings, cell.model
    calibrate = f"run `impactcell calibrate {cell.path} -o {settings.model.name}`"
    if not model.predictors:
        yield _Remark(
            ("model",),
            f"model '{model.name}' has no predictors: friction cannot be told from peak force or distance; "
            f"{calibrate}",
        )
    else:
        yield from _of_predictors(cell, calibrate)
    stroke_mm = settings.actuator.stroke_mm
    if stroke_mm is not None and model.predictors:
        other_mm = model.stroke_m * 1e3
        if not abs(stroke_mm - other_mm) <= STROKE_TOLERANCE * stroke_mm:
            yield _Remark(
                ("actuator", "stroke_mm"),
                f"the stroke is {stroke_mm:g} mm, model '{model.name}' was calibrated for {other_mm:g} mm; "
                f"{calibrate}",
            )
    if settings.alarms.wear_limit <= model.plant.mu_s:
        yield _Remark(
            ("alarms", "wear_limit"),
            f"the wear limit {settings.alarms.wear_limit:g} is not above the friction of the model itself "
            f"(mu_s {model.plant.mu_s:.4g}): the alarm would stand from the first cycle on",
        )


def _of_predictors(cell: CellConfig, calibrate: str) -> Iterator[_Remark]:
    settings, predictors = cell.settings, cell.model.predictors
    lightest, heaviest = predictors[0].mass_kg, predictors[-1].mass_kg
    mass_kg = settings.part.mass_kg
    if mass_kg is not None and not lightest <= mass_kg <= heaviest:
        yield _Remark(
            ("part", "mass_kg"),
            f"the part has {mass_kg:g} kg, model '{cell.model.name}' is calibrated for {lightest:.4g} to "
            f"{heaviest:.4g} kg; {calibrate}",
        )
    highest = max(predictor.mu_s_range[1] for predictor in predictors)
    if settings.alarms.wear_limit > highest:
        yield _Remark(
            ("alarms", "wear_limit"),
            f"the model is calibrated up to mu_s {highest:.4g} only: values near the wear limit will be "
            f"uncertain; {calibrate}",
            is_fault=False,
        )
    slowest, fastest = predictors[0].velocity_range_m_s
    limit = settings.actuator.max_velocity_mm_per_min
    if limit < slowest * 60e3 * (1.0 - 1e-9):
        yield _Remark(
            ("actuator", "max_velocity_mm_per_min"),
            f"taps are at most {limit:g} mm/min, the model is calibrated for {slowest * 60e3:g} to "
            f"{fastest * 60e3:g} mm/min; {calibrate}",
        )


def _of_map(cell: CellConfig) -> Iterator[_Remark]:
    registers = cell.register_map
    for text in (*unknown_names(registers.registers), *not_promised(registers)):
        yield _Remark(("module", "register_map"), f"{registers.name}: {text}", is_fault=False)
    stroke_mm = cell.settings.actuator.stroke_mm
    for name, section, key, value, unit, scale in (
        ("mass", "part", "mass_kg", cell.settings.part.mass_kg, "kg", 1.0),
        ("stroke", "actuator", "stroke_mm", stroke_mm, "mm", 1e3),
    ):
        said = scale * registers.constants.get(name, math.nan)
        if value is not None and abs(said - value) > CONSTANT_TOLERANCE * value:
            yield _Remark(
                (section, key),
                f"the {name} is {value:g} {unit} here and always {said:g} {unit} in the register map, which "
                f"counts; put the constant of {registers.name} right, or take it out",
            )


def _of_service(cell: CellConfig) -> Iterator[_Remark]:
    settings = cell.settings
    users = settings.opcua.users_file
    if not users.is_file():
        yield _Remark(
            ("opcua", "users_file"),
            f"there is no users file {users}: nobody can log in, over OPC UA or on the page; run "
            f"`impactcell users add {users}`",
            is_fault=False,
        )
    if settings.journal is None:
        yield _Remark((), "no journal: what the cell learns is lost with every restart", is_fault=False)
