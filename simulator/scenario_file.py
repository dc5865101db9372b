"""Reads a scenario file and checks it against its model; every fault with file, line and key path."""

import re
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from impactcell.errors import SettingsError

KeyPath = tuple[str | int, ...]


class ScenarioModel(BaseModel):
    """Base of everything in a scenario: unknown keys are faults, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


MOST_VALUES = 100_000
"""A file of nested aliases can describe more than memory holds; no honest one comes near this."""

M = TypeVar("M", bound=ScenarioModel)


class _Loader(yaml.SafeLoader):
    """YAML 1.2 numbers: `1e-6` is a number here, as everyone expects."""


_Loader.yaml_implicit_resolvers = {
    first: [entry for entry in entries if entry[0] != "tag:yaml.org,2002:timestamp"]
    for first, entries in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def load(file: Path, model: type[M]) -> M:
    """Read `file` as a `model`.

    Raises
    ------
    SettingsError
        Every fault at once, as `file:line:column: key.path: message`.
    """
    content, places = read_yaml(file)
    try:
        return model.model_validate(content)
    except ValidationError as error:
        lines = [_told(file, places, fault) for fault in error.errors()]
        raise SettingsError("\n".join(lines)) from None


def read_yaml(file: Path) -> tuple[Any, dict[KeyPath, tuple[int, int]]]:
    """Content of a YAML file, and line and column of every value by its path of keys.

    Raises
    ------
    SettingsError
        It cannot be read, or is not YAML, or has a key twice.
    """
    try:
        text = file.read_text(encoding="utf-8")
    except OSError as error:
        message = f"{file}: cannot be read: {error.strerror}"
        raise SettingsError(message) from None
    except UnicodeDecodeError:
        message = f"{file}: is not UTF-8 text"
        raise SettingsError(message) from None
    try:
        return _parsed(file, text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = "" if mark is None else f"{mark.line + 1}:{mark.column + 1}:"
        message = f"{file}:{where} is not YAML: {getattr(error, 'problem', None) or error}"
        raise SettingsError(message) from None
    except RecursionError:
        message = f"{file}: is nested too deeply"
        raise SettingsError(message) from None
    except ValueError as error:
        # A scalar whose explicit tag it does not fit, such as `!!int x`.
        message = f"{file}: is not YAML: {error}"
        raise SettingsError(message) from None


def _parsed(file: Path, text: str) -> tuple[Any, dict[KeyPath, tuple[int, int]]]:
    places: dict[KeyPath, tuple[int, int]] = {}
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            message = f"{file}:1:1: is empty"
            raise SettingsError(message)
        twice = _place(node, (), places)
        if twice:
            raise SettingsError("\n".join(f"{file}:{line}:{column}: {text}" for line, column, text in twice))
        return loader.construct_document(node), places
    finally:
        loader.dispose()


def _place(
    node: yaml.Node, path: KeyPath, places: dict[KeyPath, tuple[int, int]]
) -> list[tuple[int, int, str]]:
    if len(places) > MOST_VALUES:
        message = f"has more than {MOST_VALUES} values"
        raise ValueError(message)
    places[path] = (node.start_mark.line + 1, node.start_mark.column + 1)
    faults = []
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, value in node.value:
            name = key.value if isinstance(key, yaml.ScalarNode) else "?"
            if name in seen:
                faults.append(
                    (key.start_mark.line + 1, key.start_mark.column + 1, f"{name!r} appears twice; keep one")
                )
            seen.add(name)
            faults += _place(value, (*path, name), places)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            faults += _place(value, (*path, index), places)
    return faults


def _told(file: Path, places: dict[KeyPath, tuple[int, int]], fault: Any) -> str:
    path: KeyPath = fault["loc"]
    known = path
    while known and known not in places:
        known = known[:-1]
    line, column = places[known]
    name = ".".join(str(part) for part in path) or "scenario"
    message = fault["msg"].removeprefix("Value error, ")
    if fault["type"] == "extra_forbidden":
        message = "unknown key; remove it or correct its spelling"
    elif fault["type"] == "missing":
        message = "is missing"
    return f"{file}:{line}:{column}: {name}: {message}"
