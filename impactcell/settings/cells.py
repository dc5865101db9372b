"""Cells read whole: the cell file, the register map and the model that it names."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from impactcell.errors import MapError, SettingsError
from impactcell.fieldbus.registers import RegisterMap
from impactcell.prediction.model import Model
from impactcell.process import yaml_loader
from impactcell.process.yaml_loader import Positions
from impactcell.settings.model_file import read_model
from impactcell.settings.sections import CellSettings

EVERY_HOST: Final = ("0.0.0.0", "::")  # noqa: S104 - compared with, not listened on
"""Hosts that stand for all addresses of the machine."""


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

    def fault(self, key: str, message: str) -> str:
        """Say what is wrong with a key of its file, as in `journal.file`, or else with its section."""
        return yaml_loader.format_error(self.path, self.positions.value(key.split(".")), message)


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
        settings, positions = yaml_loader.read(path, CellSettings)
        map_file: Path | None = settings.module.register_map
        model_file: Path | None = settings.model
        order = settings.module.word_order
    except SettingsError as error:
        faults.append(str(error))
        (map_file, model_file), order = _referenced_files(path), None
    try:
        register_map = None if map_file is None else read_register_map(map_file, order)
    except SettingsError as error:
        faults.append(str(error))
    try:
        model = None if model_file is None else read_model(model_file)
    except SettingsError as error:
        faults.append(str(error))
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
    if words[0] in ("register", "registers"):
        return ("registers", words[1])
    return (words[-1],) if fault.startswith("unknown key") else (words[0],)


def _port(cell: CellConfig) -> int | None:
    """Port of the cell's endpoint; None where the system chooses one."""
    return urlsplit(cell.settings.opcua.endpoint).port or None


def _listeners(cell: CellConfig) -> dict[str, tuple[str, int]]:
    """Host and port of all that a cell has listening, by the key that says so."""
    settings = cell.settings
    addresses = {"opcua.endpoint": settings.opcua.endpoint}
    if settings.web is not None:
        addresses["web.endpoint"] = settings.web.endpoint
    parts = {key: urlsplit(address) for key, address in addresses.items()}
    listeners = {key: (part.hostname or "", part.port or 0) for key, part in parts.items()}
    if settings.monitoring is not None:
        listeners["monitoring.port"] = (settings.monitoring.host, settings.monitoring.port)
    return listeners


def _port_faults(cell: CellConfig, other: CellConfig) -> list[str]:
    """Say which two kinds of listeners would be at the same port; port 0 is any that is free."""
    faults = []
    whose = "" if cell is other else f" of {other.path}"
    for key, (host, port) in _listeners(cell).items():
        for other_key, (other_host, other_port) in _listeners(other).items():
            is_told = key == other_key or (cell is other and key > other_key)
            meet = host == other_host or not {host, other_host}.isdisjoint(EVERY_HOST)
            if port and port == other_port and meet and not is_told:
                faults.append(f"{cell.path}: {key} and {other_key}{whose} are both port {port}; change one")
    return faults


def _endpoint(cell: CellConfig) -> tuple[str, int]:
    """Where the module is; cells of one endpoint share its connection."""
    module = cell.settings.module
    return (module.host, module.port) if module.serial is None else (module.serial.device, 0)


def _acknowledgement_target(cell: CellConfig) -> tuple[tuple[str, int], int, Path]:
    """Say where a cell acknowledges cycles; a device may serve several cells, each by a map of its own."""
    module = cell.settings.module
    return _endpoint(cell), module.device_id, module.register_map


def _connection_faults(cell: CellConfig, other: CellConfig) -> list[str]:
    """Say why two cells cannot share the connection to their gateway, or the line that they are on."""
    if _endpoint(cell) != _endpoint(other):
        return []
    module, shared = cell.settings.module, other.settings.module
    keys = [
        key
        for key in ("transport", "serial", "tls", "timeout_ms")
        if getattr(module, key) != getattr(shared, key)
    ]
    return [
        f"{cell.path}: {other.path} is behind the same gateway or on the same line, but has another "
        f"module.{key}; they share one connection"
        for key in keys
    ]


def _page_faults(cell: CellConfig, other: CellConfig) -> list[str]:
    """Say why two cells cannot be on one page; its users log in once for all of its cells."""
    page, other_page = cell.settings.web, other.settings.web
    if page is None or other_page is None or page.endpoint != other_page.endpoint:
        return []
    if page != other_page:
        return [f"{cell.path}: {other.path} has the same web endpoint, but other web settings"]
    if cell.settings.opcua.users_file != other.settings.opcua.users_file:
        return [
            f"{cell.path}: {other.path} is on the same page (web.endpoint), but has another opcua.users_file"
        ]
    return []


def read_cells(paths: Sequence[Path]) -> tuple[CellConfig, ...]:
    """Read the cells of one process; see that they do not get in each other's way.

    Raises
    ------
    SettingsError
        With every fault of every file.
    """
    cells, faults = [], []
    for path in paths:
        try:
            cells.append(read_cell(path))
        except SettingsError as error:
            faults.append(str(error))
    for index, cell in enumerate(cells):
        faults += _port_faults(cell, cell)
        for other in cells[:index]:
            if cell.path.resolve() == other.path.resolve():
                faults.append(f"{cell.path}: is given twice; name it once")
                continue
            faults += _port_faults(cell, other)
            if cell.name == other.name:
                faults.append(f"{cell.path}: cell '{cell.name}' is in {other.path} too; rename one")
            if _acknowledgement_target(cell) == _acknowledgement_target(other):
                faults.append(
                    f"{cell.path}: {other.path} has the same module and register map; "
                    "a module's cycles belong to one cell"
                )
            journals = cell.settings.journal, other.settings.journal
            if journals[0] and journals[1] and journals[0].file == journals[1].file:
                faults.append(
                    f"{cell.path}: {other.path} has the same journal file; a journal belongs to one cell"
                )
            faults += _connection_faults(cell, other)
            faults += _page_faults(cell, other)
            if cell.settings.opcua != other.settings.opcua and _port(cell) == _port(other):
                faults.append(f"{cell.path}: {other.path} has the same endpoint, but other opcua settings")
    if faults:
        raise SettingsError("\n".join(faults))
    return tuple(cells)
