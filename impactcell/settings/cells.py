"""Cells read whole: the cell file, the register map and the model that it names."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from impactcell.errors import MapError, SettingsError
from impactcell.fieldbus.registers import RegisterMap
from impactcell.prediction.model import Model
from impactcell.process import yaml_loader, yaml_schema
from impactcell.process.yaml_loader import Positions
from impactcell.settings.misnamed_files import MAP, MODEL, why_unusable
from impactcell.settings.model_file import read_model
from impactcell.settings.sections import CellSettings


@dataclass(frozen=True, slots=True, eq=False)
class CellConfig:
    """One cell as its files describe it."""

    path: Path
    settings: CellSettings
    register_map: RegisterMap
    model: Model
    positions: Positions

    @property
    def name(self) -> str:
        """Name of the cell, in OPC UA, in logs and in messages."""
        return self.settings.cell

    def fault(self, message: str, *keys: str) -> str:
        """Say what is wrong, with the `place` of some keys."""
        return f"{self.place(*keys)}: {message}"

    @contextlib.contextmanager
    def told_at(self, *keys: str) -> Iterator[None]:
        """Put the `place` of some keys before what a part of the service refuses of its settings."""
        try:
            yield
        except SettingsError as error:
            raise SettingsError(self.fault(str(error), *keys)) from error

    def place(self, *keys: str) -> str:
        """Say where its file has the first of some keys, as in `journal.file`, or else their section."""
        paths = [tuple(key.split(".")) for key in keys]
        whole = [path for path in paths if self.positions.existing_path(path) == path]
        place = (whole or sorted(paths, key=lambda path: -len(self.positions.existing_path(path))))[0]
        return f"{self.path}:{self.positions.value(place)}"


def read_cell(path: Path) -> CellConfig:
    """Read a cell file with the register map and the model that it names.

    Raises
    ------
    SettingsError
        With every fault of the three files, one `file:line:column: message` a line.
    """
    faults: list[str] = []
    settings = register_map = model = None
    try:
        settings, positions = yaml_schema.read(path, CellSettings)
        map_file: Path | None = settings.module.register_map
        model_file: Path | None = settings.model
        order = settings.module.word_order
    except SettingsError as error:
        faults.append(str(error))
        (map_file, model_file), order = _referenced_files(path), None
    try:
        register_map = None if map_file is None else read_register_map(map_file, order)
    except SettingsError as error:
        faults.append(_blamed(path, "module.register_map", map_file, MAP) or str(error))
    try:
        model = None if model_file is None else read_model(model_file)
    except SettingsError as error:
        faults.append(_blamed(path, "model", model_file, MODEL) or str(error))
    if settings is None or register_map is None or model is None:
        raise SettingsError("\n".join(faults))
    return CellConfig(path, settings, register_map, model, positions)


def _referenced_files(path: Path) -> tuple[Path | None, Path | None]:
    """Map and model that a faulty cell file names: their faults are told together with its own."""
    try:
        data, _ = yaml_loader.load(path)
    except SettingsError:
        return None, None
    cell = data if isinstance(data, dict) else {}
    module = cell.get("module")
    names = module.get("register_map") if isinstance(module, dict) else None, cell.get("model")
    map_file, model_file = (
        _existing(path.parent / name) if isinstance(name, str) else None for name in names
    )
    return map_file, model_file


def _blamed(path: Path, key: str, file: Path | None, kind: str) -> str:
    """Put the fault of a file that is no `kind` where a cell file names it; empty if it is one."""
    why = "" if file is None else why_unusable(file, kind)
    if not why:
        return ""
    _, positions = yaml_loader.load(path)
    return yaml_loader.format_error(path, positions.value(key.split(".")), f"{key}: {why}")


def _existing(file: Path) -> Path | None:
    try:
        return file if file.is_file() else None
    except OSError:
        return None


def read_register_map(path: Path, word_order: str | None = None) -> RegisterMap:
    """Read a register map; `word_order` takes the place of the map's own.

    Raises
    ------
    SettingsError
        With every fault of the file, each with its place.
    """
    data, positions = yaml_loader.load(path)
    if not isinstance(data, dict):
        raise SettingsError(f"{path}:1:1: a register map is a mapping of format, name and registers")
    try:
        register_map = RegisterMap.from_mapping(data)
    except MapError as error:
        places = [positions.key(_place_in_map(fault)) for fault in error.faults]
        lines = [f"{path}:{place}: {fault}" for place, fault in zip(places, error.faults, strict=True)]
        raise SettingsError("\n".join(lines)) from error
    return register_map if word_order is None else register_map.with_word_order(word_order)


def _place_in_map(fault: str) -> tuple[str, ...]:
    """Say what part of a map file a fault is about."""
    words = fault.replace(":", " ").split()
    if fault.startswith("is of format"):
        return ("format",)
    if words[0] in ("register", "registers"):
        return ("registers", words[1])
    return (words[-1],) if fault.startswith("unknown key") else (words[0],)
