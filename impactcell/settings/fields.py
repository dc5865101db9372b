"""What the sections of a cell file are made of: paths, ranges, addresses, names."""

import re
from ipaddress import ip_address
from pathlib import Path
from typing import Annotated, Final
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from impactcell.fieldbus.link import NO_NAME


def _resolved(value: object, info: ValidationInfo) -> object:
    if not isinstance(value, str) or not value:
        return value
    directory: Path = (info.context or {}).get("directory", Path())
    try:
        path = (directory / Path(value).expanduser()).resolve()
        path.is_dir()  # what no file can be called, or nobody may look at, is found here
    except (OSError, RuntimeError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ValueError(f"{value!r} cannot be used as a path ({reason}); name another") from error
    return path


def _no_directory(path: Path) -> Path:
    if path.is_dir():
        raise ValueError(f"{path} is a directory; a file is needed here")
    return path


def _existing_file(path: Path) -> Path:
    if not _no_directory(path).is_file():
        raise ValueError(f"there is no file {path}")
    return path


def _existing_model(path: Path) -> Path:
    if not _no_directory(path).is_file():
        raise ValueError(
            f"there is no file {path}; `impactcell init` writes a first model, fitted to taps (`--campaign`) "
            "or to record the first ones with"
        )
    return path


def _existing_parent(path: Path) -> Path:
    if not _no_directory(path).parent.is_dir():
        raise ValueError(f"there is no directory {path.parent} to write it in")
    return path


def _no_file_in_its_way(path: Path, info: ValidationInfo) -> Path:
    existing = next((part for part in (path, *path.parents) if part.exists()), path)
    if existing.exists() and not existing.is_dir():
        raise ValueError(
            f"{existing} is a file, {info.field_name} names a directory; name another, "
            "which is made where it is not there"
        )
    return path


AnyPath = Annotated[Path, BeforeValidator(_resolved)]
InputFile = Annotated[AnyPath, AfterValidator(_existing_file)]
ModelFile = Annotated[AnyPath, AfterValidator(_existing_model)]
OutputDirectory = Annotated[AnyPath, AfterValidator(_no_file_in_its_way)]
"""A directory that is there, or can be made."""
OutputFile = Annotated[AnyPath, AfterValidator(_existing_parent)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
"""A finite number above 0."""
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
"""A finite number of at least 0."""
Probability = Annotated[float, Field(gt=0, lt=1)]
"""A number between 0 and 1, both excluded."""
_PORT: Final = re.compile(r"(?<![:\[]):(\d+)$")
"""Port behind a host; an IPv6 address has colons of its own."""


def opcua_endpoint(value: str) -> str:
    """See that an OPC UA endpoint is whole."""
    parts = urlsplit(value)
    try:
        whole = parts.scheme == "opc.tcp" and bool(parts.hostname) and parts.port is not None
    except ValueError:
        whole = False
    if not whole:
        raise ValueError("an OPC UA endpoint has host and port, as in opc.tcp://127.0.0.1:4840/impactcell")
    return value


def page_endpoint(value: str) -> str:
    """See that the address of a page is whole."""
    parts = urlsplit(value)
    try:
        is_whole = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port is not None
    except ValueError:
        is_whole = False
    if not is_whole or parts.path not in ("", "/") or parts.query or parts.fragment or parts.username:
        raise ValueError("a page's endpoint has scheme, host and port, as in http://127.0.0.1:8480")
    return value.rstrip("/")


def public_address(value: str) -> str:
    """See that the address of a page behind a proxy is one, and write it as browsers do.

    >>> public_address("https://Cells.plant.example:443/")
    'https://cells.plant.example'
    """
    parts = urlsplit(value)
    try:
        host, port = parts.hostname or "", parts.port
    except ValueError:
        host, port = "", None
    scheme_port = {"http": 80, "https": 443}.get(parts.scheme)
    if scheme_port is None or not (host.isascii() and _is_host(host)) or port == 0 or "@" in parts.netloc:
        raise ValueError(
            "the address in the browser has scheme and host, and a port where it is not the usual one, "
            "as in https://cells.plant.example"
        )
    if parts.path not in ("", "/") or parts.query or parts.fragment:
        raise ValueError(
            f"the address in the browser has no path here: give the page a host of its own, not {host}"
        )
    written = f"[{host}]" if ":" in host else host
    return f"{parts.scheme}://{written}{f':{port}' if port not in (None, scheme_port) else ''}"


def module_host(value: str) -> str:
    """See that a host is a name or an address alone, as a connection is opened to it.

    >>> module_host("10.0.0.5"), module_host("fe80::1%eth0")
    ('10.0.0.5', 'fe80::1%eth0')
    >>> module_host("tcp://press-1:502/")
    Traceback (most recent call last):
    ValueError: a host is a name or an address alone: write `host: press-1` and `port: 502`
    """
    if _is_host(value):
        return host_name(value)
    bare = re.sub(r"^\w[\w+.-]*://|[/?#].*$", "", value.strip())
    name, port = _PORT.sub("", bare).strip("[]"), _PORT.search(bare)
    meant = f"`host: {name}`" if _is_host(name) else "it as in `host: 10.0.0.5` or `host: press-1.local`"
    behind = f" and `port: {port[1]}`" if port and _is_host(name) else ""
    raise ValueError(f"a host is a name or an address alone: write {meant}{behind}")


def host_name(value: str) -> str:
    """See that the network can be asked for a name, and a certificate carry it.

    >>> host_name("press-1..plant")
    Traceback (most recent call last):
    ValueError: a host's name has 1 to 63 characters between its dots, as in press-1.local
    """
    try:
        value.encode("idna")
    except UnicodeError as error:
        raise ValueError(f"{NO_NAME}, as in press-1.local") from error
    return value


def _is_host(value: str) -> bool:
    try:
        ip_address(value)
    except ValueError:
        is_number = re.fullmatch(r"[\d.]*", value) is not None
        return not is_number and re.fullmatch(r"\w[\w.-]*", value) is not None
    return True


def cell_name(value: str) -> str:
    """See that a name can be part of NodeIds, files and addresses."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}", value):
        raise ValueError(
            "a cell's name has up to 64 letters (a to z), digits, '_', '-' or '.', as in press-1"
        )
    return value


class Section(BaseModel):
    """A mapping of the cell file; unknown keys are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True)
