"""The cells of one process: what each says for itself, and where two would get in each other's way."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from impactcell.errors import SettingsError
from impactcell.fieldbus.hosts import host_identity
from impactcell.settings.cells import CellConfig, read_cell
from impactcell.settings.fields import Section

EVERY_HOST: Final = ("0.0.0.0", "::")  # noqa: S104 - compared with, not listened on
"""Hosts that stand for all addresses of the machine."""


def read_cells(paths: Sequence[Path]) -> tuple[CellConfig, ...]:
    """Read the cells of one process; see that they do not get in each other's way.

    Raises
    ------
    SettingsError
        With every fault of every file.
    """
    cells: list[CellConfig] = []
    faults: list[str] = []
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
            else:
                faults += _port_faults(cell, other)
                faults += _faults_of_sharing(cell, other)
                faults += _connection_faults(cell, other)
                faults += _page_faults(cell, other)
                faults += _server_faults(cell, other)
    if faults:
        raise SettingsError("\n".join(faults))
    return tuple(cells)


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


def _port_faults(cell: CellConfig, other: CellConfig) -> Iterator[str]:
    """Say which two kinds of listeners would be at the same port; port 0 is any that is free."""
    whose = "" if cell is other else f" of {other.path}"
    for key, (host, port) in _listeners(cell).items():
        for other_key, (other_host, other_port) in _listeners(other).items():
            is_told = key == other_key or (cell is other and key > other_key)
            meet = host_identity(host) == host_identity(other_host) or not {host, other_host}.isdisjoint(
                EVERY_HOST
            )
            if port and port == other_port and meet and not is_told:
                keys = (key, other_key) if cell is other else (key,)
                message = f"{key} and {other_key}{whose} are both port {port}; change one"
                yield cell.fault(message, *keys)


def _acknowledgement_target(cell: CellConfig) -> tuple[tuple[str, int], int, Path]:
    """Say where a cell acknowledges cycles; a device may serve several cells, each by a map of its own."""
    module = cell.settings.module
    return module.link.endpoint, module.device_id, module.register_map


def _faults_of_sharing(cell: CellConfig, other: CellConfig) -> Iterator[str]:
    """Say what two cells have in common that is one cell's."""
    if cell.name == other.name:
        yield cell.fault(f"cell '{cell.name}' is in {other.path} too; rename one", "cell")
    if _acknowledgement_target(cell) == _acknowledgement_target(other):
        yield cell.fault(
            f"module: {other.path} has the same module and register map; a module's cycles belong to one "
            "cell: change host, port or device_id of one, or give one another register_map",
            "module.port",
            "module.device_id",
        )
    journals = cell.settings.journal, other.settings.journal
    if journals[0] and journals[1] and journals[0].file == journals[1].file:
        yield cell.fault(
            f"journal.file: {other.path} has the same journal file; a journal belongs to one cell: "
            "name another file",
            "journal.file",
        )


def _connection_faults(cell: CellConfig, other: CellConfig) -> Iterator[str]:
    """Say why two cells cannot share the connection to their gateway, or the line that they are on."""
    module, shared = cell.settings.module, other.settings.module
    if module.link.endpoint != shared.link.endpoint:
        return
    for key in ("transport", "serial", "tls", "timeout_ms"):
        if getattr(module, key) != getattr(shared, key):
            yield cell.fault(
                f"{other.path} is behind the same gateway or on the same line, but has another "
                f"module.{key}; they share one connection: give both the same",
                f"module.{key}",
            )
    for one, beside in ((cell, other), (other, cell)):
        window = one.settings.module.window
        if window is not None and window > 1:
            yield one.fault(
                f"`window: {window}` is for a module with an endpoint of its own; {beside.path} is behind "
                "the same gateway, which is asked one request at a time: leave it out",
                "module.window",
            )


def _page_faults(cell: CellConfig, other: CellConfig) -> Iterator[str]:
    """Say why two cells cannot be on one page; its users log in once for all of its cells."""
    page, other_page = cell.settings.web, other.settings.web
    if page is None or other_page is None or page.endpoint != other_page.endpoint:
        return
    users, other_users = cell.settings.opcua.users_file, other.settings.opcua.users_file
    if page != other_page:
        keys = _differing(page, other_page)
        yield cell.fault(
            f"{other.path} has the same web endpoint, but other web settings: "
            f"{_both('web', page, other_page)}; cells on one page have one page's: give both the same, "
            "or one a web.endpoint of its own",
            *(f"web.{key}" for key in keys),
            "web.endpoint",
        )
    elif users != other_users:
        yield cell.fault(
            f"{other.path} is on the same page (web.endpoint), but has another opcua.users_file "
            f"({users} here, {other_users} there); give both the same, or one a web.endpoint of its own",
            "opcua.users_file",
        )


def _server_faults(cell: CellConfig, other: CellConfig) -> Iterator[str]:
    """Say why two cells cannot be on one OPC UA server."""
    opcua, other_opcua = cell.settings.opcua, other.settings.opcua
    if opcua == other_opcua or _port(cell) != _port(other):
        return
    keys = _differing(opcua, other_opcua)
    where = "port" if "endpoint" in keys else "endpoint"
    yield cell.fault(
        f"{other.path} has the same {where}, but other opcua settings: "
        f"{_both('opcua', opcua, other_opcua)}; cells at one port share one server: give both the same, "
        "or one an opcua.endpoint of another port",
        *(f"opcua.{key}" for key in keys),
        "opcua.endpoint",
    )


def _differing(section: Section, other: Section) -> list[str]:
    return [key for key in type(section).model_fields if getattr(section, key) != getattr(other, key)]


def _both(name: str, section: Section, other: Section) -> str:
    """Say what each key of a section is here and there, where it is not the same."""
    return ", ".join(
        f"{name}.{key} is {_said(getattr(section, key))} here and {_said(getattr(other, key))} there"
        for key in _differing(section, other)
    )


def _said(value: object) -> str:
    """Say a value as a cell file has it."""
    if isinstance(value, bool):
        return str(value).lower()
    return "absent" if value is None else str(value)
