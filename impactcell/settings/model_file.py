"""Model files: what `impactcell calibrate` writes and a cell's YAML names."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from impactcell.errors import ImpactCellError, PhysicsError, SettingsError
from impactcell.physics import Plant
from impactcell.physics.effects import LIBRARY
from impactcell.physics.outside_effects import offer_effects, offer_installed, source_of
from impactcell.prediction.model import DistanceForm, ForceForm, Model, Predictor, Prior, Sensitivity
from impactcell.process import yaml_loader, yaml_schema
from impactcell.process.whole_files import write_whole
from impactcell.settings.model_sections import INCOMPLETE, ModelFile, ParameterFile

HEADER = """\
# A model of impactcell: plant, how well it is known, and the predictors calibrated to it.
# Equation (4): F_p = friction_n mu_s + velocity_n_s_per_m v
# Equation (5): d = square_m u^square_power (limit - mu_s)^2 + offset_m u^offset_power, u = v / (0.1 m/s)
"""


def read_model(path: Path) -> Model:
    """Read a model file.

    Raises
    ------
    SettingsError
        Listing every fault as `file:line:column: message`.
    """
    file, positions = yaml_schema.read(path, ModelFile)
    faults = []
    try:
        offer_effects([path.parent / name for name in file.effect_files])
        offer_installed()
    except PhysicsError as fault:
        where = positions.value(("effect_files",)) if file.effect_files else positions.value(())
        raise SettingsError(yaml_loader.format_error(path, where, str(fault))) from fault
    for identifier, parameters in file.plant.effects.items():
        location = ("plant", "effects", identifier)
        if identifier not in LIBRARY:
            suggestion = yaml_loader.suggest(identifier, LIBRARY)
            faults.append(
                yaml_loader.format_error(
                    path, positions.key(location), f"no effect {identifier!r}; {suggestion}"
                )
            )
            continue
        parameter_names = [parameter.name for parameter in LIBRARY[identifier].parameters]
        faults += [
            yaml_loader.format_error(
                path,
                positions.key((*location, name)),
                f"{identifier} has no parameter {name!r}; {yaml_loader.suggest(name, parameter_names)}",
            )
            for name in parameters
            if name not in parameter_names
        ]
    if faults:
        raise SettingsError("\n".join(faults))
    try:
        return _from_file(file)
    except ImpactCellError as fault:
        raise SettingsError(
            yaml_loader.format_error(path, positions.value(("plant",)), str(fault))
        ) from fault


def write_model(model: Model, path: Path) -> None:
    """Write a model file, whole or not at all; the same model gives the same bytes.

    Raises
    ------
    SettingsError
        The file cannot be written.
    """
    _write(_to_mapping(model), path)


def write_part_of_model(
    name: str,
    missing: str,
    plant: Mapping[str, object],
    provenance: Mapping[str, str],
    path: Path,
) -> None:
    """Write what is known of a model where that is a part of it; who reads it as a model is told `missing`.

    Raises
    ------
    SettingsError
        The file cannot be written.
    """
    _write(
        {"format": 1, "name": name, INCOMPLETE: missing, "plant": plant, "provenance": dict(provenance)}, path
    )


def _write(content: Mapping[str, object], path: Path) -> None:
    text = HEADER + yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=110)
    try:
        write_whole(path, text)
    except OSError as fault:
        raise SettingsError(f"{path}: cannot be written: {fault.strerror}") from fault


def _from_file(file: ModelFile) -> Model:
    effects: dict[str, dict[str, float | Sequence[float]]] = {}
    intervals: dict[str, dict[str, tuple[float, float]]] = {}
    for identifier, parameters in file.plant.effects.items():
        effects[identifier] = {}
        for name, parameter_value in parameters.items():
            if isinstance(parameter_value, ParameterFile):
                effects[identifier][name] = parameter_value.value
                if parameter_value.ci95 is not None:
                    intervals.setdefault(identifier, {})[name] = parameter_value.ci95
            else:
                effects[identifier][name] = (
                    tuple(parameter_value) if isinstance(parameter_value, list) else parameter_value
                )
    plant = Plant(
        stiffness_n_per_m=file.plant.stiffness_n_per_m,
        damping_n_s_per_m=file.plant.damping_n_s_per_m,
        mu_s=file.plant.mu_s,
        mu_k=file.plant.mu_k,
        gravity_m_s2=file.plant.gravity_m_s2,
        effects=effects,
    )
    predictors = tuple(
        Predictor(
            mass_kg=predictor.mass_kg,
            mu_s_range=predictor.mu_s_range,
            velocity_range_m_s=predictor.velocity_range_m_s,
            force=ForceForm(**predictor.force.model_dump()),
            distance=DistanceForm(**predictor.distance.model_dump()),
            force_sensitivity=Sensitivity(**predictor.force_sensitivity.model_dump()),
            distance_sensitivity=Sensitivity(**predictor.distance_sensitivity.model_dump()),
        )
        for predictor in sorted(
            file.predictors, key=lambda predictor: (predictor.mass_kg, predictor.velocity_range_m_s)
        )
    )
    return Model(
        name=file.name,
        plant=plant,
        prior=Prior(**file.prior.model_dump()),
        predictors=predictors,
        stroke_m=math.inf if file.stroke_m is None else file.stroke_m,
        intervals=intervals,
        provenance=file.provenance,
    )


def _to_mapping(model: Model) -> dict[str, object]:
    plant, prior = model.plant, model.prior

    def parameter(effect: str, name: str, value: float | Sequence[float]) -> object:
        if isinstance(value, Sequence):
            return _floats(value)
        interval = model.intervals.get(effect, {}).get(name)
        return float(value) if interval is None else {"value": float(value), "ci95": _floats(interval)}

    mapping: dict[str, object] = {
        "format": 1,
        "name": model.name,
        "plant": {
            "stiffness_n_per_m": float(plant.stiffness_n_per_m),
            "damping_n_s_per_m": float(plant.damping_n_s_per_m),
            "mu_s": float(plant.mu_s),
            "mu_k": float(plant.mu_k),
            "gravity_m_s2": float(plant.gravity_m_s2),
            "effects": {
                effect: {name: parameter(effect, name, value) for name, value in parameters.items()}
                for effect, parameters in plant.effects.items()
            },
        },
        "prior": _slots(prior),
        "stroke_m": None if math.isinf(model.stroke_m) else float(model.stroke_m),
        "predictors": [
            {
                "mass_kg": float(predictor.mass_kg),
                "mu_s_range": _floats(predictor.mu_s_range),
                "velocity_range_m_s": _floats(predictor.velocity_range_m_s),
                "force": _slots(predictor.force),
                "distance": _slots(predictor.distance),
                "force_sensitivity": _slots(predictor.force_sensitivity),
                "distance_sensitivity": _slots(predictor.distance_sensitivity),
            }
            for predictor in model.predictors
        ],
        "provenance": dict(model.provenance),
    }
    sources = [str(source) for effect in plant.effects if (source := source_of(effect)) is not None]
    if sources:
        mapping["effect_files"] = sources
    return mapping


def _floats(values: Sequence[float]) -> list[float]:
    return [float(value) for value in values]


def _slots(record: Prior | ForceForm | DistanceForm | Sensitivity) -> dict[str, float]:
    return {name: float(getattr(record, name)) for name in type(record).__slots__}
