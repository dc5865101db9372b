"""A cell judged as a whole: files that are right each for itself, and do not fit each other."""

import math
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from statistics import median
from typing import Final

from impactcell.errors import JournalError
from impactcell.features import noise_std
from impactcell.fieldbus.map_promises import not_promised
from impactcell.fieldbus.positioning_registers import not_placing
from impactcell.fieldbus.register_map.map_registers import unknown_names
from impactcell.journal.store import Journal
from impactcell.physics.local_friction import goes_with_place
from impactcell.prediction.mass_interpolation import velocity_range_m_s
from impactcell.process import yaml_loader
from impactcell.process.yaml_loader import FilePosition
from impactcell.records import MM_PER_MIN
from impactcell.settings.cells import CellConfig
from impactcell.settings.commanded_taps import doubted_commands
from impactcell.settings.plausible_tap import doubted_values, immovable
from impactcell.settings.remark import Remark
from impactcell.settings.service_files import of_service

STROKE_TOLERANCE: Final = 0.01
"""A cell's stroke may differ from its model's by this share: less than a stroke is known to."""
CONSTANT_TOLERANCE: Final = 1e-3
"""A constant of a map may differ from what the cell file says by this share: rounding."""
LARGEST_NOISE: Final = 0.05
"""Of the signal of the cell's fastest tap; a sensor with more tells nothing of it. Our choice."""
SMALLEST_NOISE: Final = {"force": 1e-6, "position": 1e-4}
"""In N and µm: the weight of a speck of dust, the size of an atom. What follows a tap within a millisecond
is far coarser. Our choice."""
NOISE_UNITS: Final = {"force": {"mN": 1e-3, "kN": 1e3}, "position": {"nm": 1e-3, "mm": 1e3, "m": 1e6}}
"""What a noise may have been said in, by what one of them is in N or µm."""
LEAST_USUAL_NOISE: Final = 0.01
"""In N or µm: below it no unit is proposed."""
NOISE_TOLERANCE: Final = 1.5
"""Noise measured over noise said, beyond which a good model will have a gap of as much. Our choice."""
NOISE_TAPS: Final = 10
"""Taps of the journal in which noise is measured."""


@dataclass(frozen=True, slots=True)
class CellFinding:
    """Something about a cell as a whole, and where in its file it is said.

    Attributes
    ----------
    is_fault : bool
        The cell cannot do what it is for; else it can, but its user should know.
    section : str
        Section of the file that it is about; empty where it is about the whole.
    """

    path: Path
    position: FilePosition
    message: str
    is_fault: bool
    section: str

    def __str__(self) -> str:
        return f"{self.path}:{self.position}: {'' if self.is_fault else 'note: '}{self.message}"


def judge_cell(cell: CellConfig) -> list[CellFinding]:
    """Say what of a cell does not fit together, faults first.

    Raises
    ------
    SettingsError
        Its file is not what it was.
    """
    _, positions = yaml_loader.load(cell.path)
    remarks = [*_of_model(cell), *_of_units(cell), *_of_sensors(cell), *_of_map(cell), *of_service(cell)]
    findings = [
        CellFinding(
            cell.path,
            positions.value(remark.place),
            remark.message,
            remark.is_fault,
            remark.place[0] if remark.place else "",
        )
        for remark in remarks
    ]
    return sorted(findings, key=lambda finding: not finding.is_fault)


def _of_units(cell: CellConfig) -> Iterator[Remark]:
    if still := immovable(cell):
        yield Remark(("part", "mass_kg"), still)
    for place, doubt in doubted_values(cell):
        yield Remark(place, doubt, is_fault=False)


def _of_model(cell: CellConfig) -> Iterator[Remark]:
    settings, model = cell.settings, cell.model
    calibrate = _calibrate(cell)
    if not model.predictors:
        yield Remark(
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
            yield Remark(
                ("actuator", "stroke_mm"),
                f"the stroke is {stroke_mm:g} mm, model '{model.name}' was calibrated for {other_mm:g} mm; "
                f"{calibrate}",
            )
    # Of a plant whose friction goes with the place mu_s is that of x = 0, where no tap may be.
    if settings.alarms.wear_limit <= model.plant.mu_s and not goes_with_place(model.plant):
        yield Remark(
            ("alarms", "wear_limit"),
            f"the wear limit {settings.alarms.wear_limit:g} is not above the friction of the model itself "
            f"(mu_s {model.plant.mu_s:.4g}): the alarm would stand from the first cycle on",
        )


def _calibrate(cell: CellConfig) -> str:
    """Say how to calibrate a model for a cell: in its place where it lies beside the cell, else beside it.

    Other cells may run with a model that lies elsewhere.
    """
    model = cell.settings.model
    is_own = cell.path.resolve().parent in model.resolve().parents
    target = model if is_own else cell.path.with_name(f"{cell.name}-model.yaml")
    command = shlex.join(["impactcell", "calibrate", str(cell.path), "-o", str(target)])
    if is_own:
        return f"run `{command}`, which keeps its plant"
    return f"run `{command}`, which keeps its plant, and name that file as `model` (others may use this one)"


def _of_predictors(cell: CellConfig, calibrate: str) -> Iterator[Remark]:
    settings, predictors = cell.settings, cell.model.predictors
    lightest, heaviest = predictors[0].mass_kg, predictors[-1].mass_kg
    mass_kg = settings.part.mass_kg
    if mass_kg is not None and not lightest <= mass_kg <= heaviest:
        yield Remark(
            ("part", "mass_kg"),
            f"the part has {mass_kg:g} kg, model '{cell.model.name}' is calibrated for {lightest:.4g} to "
            f"{heaviest:.4g} kg; {calibrate}",
        )
    highest = max(predictor.mu_s_range[1] for predictor in predictors)
    if settings.alarms.wear_limit > highest:
        yield Remark(
            ("alarms", "wear_limit"),
            f"the model is calibrated up to mu_s {highest:.4g} only: values near the wear limit will be "
            f"uncertain; {calibrate}",
            is_fault=False,
        )
    limit = settings.actuator.max_velocity_mm_per_min
    slowest, fastest = velocity_range_m_s(cell.model, mass_kg or lightest)
    if limit < slowest / MM_PER_MIN * (1.0 - 1e-9):
        yield Remark(
            ("actuator", "max_velocity_mm_per_min"),
            f"taps are at most {limit:g} mm/min, the model is calibrated for {slowest / MM_PER_MIN:g} to "
            f"{fastest / MM_PER_MIN:g} mm/min; {calibrate}",
        )


def _of_sensors(cell: CellConfig) -> Iterator[Remark]:
    """Say where the noise of a sensor was never said, cannot be, or is larger in recorded taps."""
    sensors, plant = cell.settings.sensors, cell.model.plant
    velocity, mass_kg = (
        cell.settings.actuator.max_velocity_mm_per_min * MM_PER_MIN,
        cell.settings.part.mass_kg,
    )
    # of a tap without losses: all of m v²/2 in the contact's spring, and then into friction
    peak_n = velocity * math.sqrt(plant.stiffness_n_per_m * (mass_kg or math.inf))
    slide_um = 1e6 * velocity**2 / (2.0 * plant.mu_k * plant.gravity_m_s2)
    for sensor, key, unit, per_si, largest in (
        ("force", "force_noise_std_n", "N", 1.0, peak_n),
        ("position", "position_noise_std_um", "µm", 1e6, slide_um),
    ):
        if sensor not in cell.register_map:
            continue
        said, measured = getattr(sensors, key), per_si * _measured_noise(cell, sensor)
        shown = f"the first taps of its journal show {measured:.2g} {unit}"
        if key not in sensors.model_fields_set:
            message = f"how noisy the {sensor} sensor is was not said: {said:g} {unit} is taken, a guess"
            message += "" if math.isnan(measured) else f"; {shown}"
            yield Remark(("sensors",), f"{message}; say `{key}` under `sensors`", is_fault=False)
        elif said > LARGEST_NOISE * largest:
            why = f"the fastest tap shows some {largest:.0f} {unit}"
            yield Remark(
                ("sensors", key),
                f"a noise of {said:g} {unit} cannot be: {why}; {_noise_meant(said, sensor, largest)}",
            )
        elif said < SMALLEST_NOISE[sensor]:
            why = f"no sensor that follows a tap has less than {SMALLEST_NOISE[sensor]:g} {unit}"
            yield Remark(
                ("sensors", key),
                f"a noise of {said:g} {unit} cannot be: {why}; {_noise_meant(said, sensor, largest)}",
            )
        elif measured > NOISE_TOLERANCE * said:
            yield Remark(
                ("sensors", key),
                f"a noise of {said:g} {unit} is too little: {shown}; every cycle will look as if the model "
                "lacked something",
                is_fault=False,
            )


def _noise_meant(said: float, sensor: str, largest: float) -> str:
    """Say in which units a noise that cannot be would be one, and what to write then."""
    values = {unit: factor * said for unit, factor in NOISE_UNITS[sensor].items()}
    meant = {
        unit: f"{value:g}"
        for unit, value in values.items()
        if LEAST_USUAL_NOISE <= value <= LARGEST_NOISE * largest
    }
    if not meant:
        return "check its unit"
    return f"if that was meant in {' or '.join(meant)}, write {' or '.join(meant.values())}"


def _measured_noise(cell: CellConfig, sensor: str) -> float:
    """Noise of a sensor in the journal's first taps, SI; nan without any, or where the module says it."""
    journal = cell.settings.journal
    if journal is None or not journal.file.is_file():
        return math.nan
    try:
        with Journal(journal.file, cell.name, read_only=True) as stored:
            captures = list(islice(stored.captures(damaged=lambda _: None), NOISE_TAPS))
    except JournalError:  # `run` and `model fit` say what is wrong with it
        return math.nan
    channels = [getattr(capture, sensor) for capture in captures]
    noise = [noise_std(c) for c in channels if c is not None and c.noise_std is None]
    return median(noise) if noise else math.nan


def _of_map(cell: CellConfig) -> Iterator[Remark]:
    registers = cell.register_map
    for text in (*unknown_names(registers.registers), *not_promised(registers)):
        yield Remark(("module", "register_map"), f"{registers.name}: {text}", is_fault=False)
    for text in not_placing(registers) if cell.settings.positioning is not None else ():
        yield Remark(("positioning",), f"register map {registers.name}: {text}")
    for place, text, is_fault in doubted_commands(cell):
        yield Remark(place, text, is_fault)
    stroke_mm = cell.settings.actuator.stroke_mm
    for name, section, key, value, unit, scale in (
        ("mass", "part", "mass_kg", cell.settings.part.mass_kg, "kg", 1.0),
        ("stroke", "actuator", "stroke_mm", stroke_mm, "mm", 1e3),
    ):
        said = scale * registers.constants.get(name, math.nan)
        if value is not None and abs(said - value) > CONSTANT_TOLERANCE * value:
            yield Remark(
                (section, key),
                f"the {name} is {value:g} {unit} here and always {said:g} {unit} in the register map, which "
                f"counts; put the constant of {registers.name} right, or take it out",
            )
