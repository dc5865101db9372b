"""YAML read into a pydantic model: what its schema finds wrong is told as `file:line:column: message`."""

import types
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from impactcell.errors import SettingsError
from impactcell.process.file_format import newer_format
from impactcell.process.written_numbers import DECIMAL_POINT, number_meant
from impactcell.process.yaml_loader import (
    FilePosition,
    Location,
    Positions,
    dotted,
    format_error,
    load,
    suggest,
)

M = TypeVar("M", bound=BaseModel)
Fault = tuple[FilePosition, str]


def read(path: Path, schema: type[M]) -> tuple[M, Positions]:
    """Read a file into a pydantic model; validators find the file's directory in their context.

    A key with nothing after it is a fault, also where `null` may be written: who leaves it out says so.

    Raises
    ------
    SettingsError
        With every fault of the file, one `file:line:column: message` a line.
    """
    data, positions = load(path)
    content, errors = None, []
    try:
        content = schema.model_validate(data, context={"directory": path.parent})
    except ValidationError as error:
        errors = error.errors(include_url=False)
    empty = _empty_keys(errors, positions)
    faults = [
        *(_explain(error, positions, schema) for error in errors if _place_of(error, positions) not in empty),
        *(_explain_empty(location, positions, schema) for location in empty),
    ]
    if content is None or faults:
        raise SettingsError("\n".join(_written(path, faults)))
    return content, positions


def _written(path: Path, faults: list[Fault]) -> list[str]:
    """Write faults as `file:line:column: message`, in the order of the file, each once."""
    lines = {(place.line, place.column, format_error(path, place, message)) for place, message in faults}
    return [text for _, _, text in sorted(lines)]


def _place_of(error: ErrorDetails, positions: Positions) -> Location:
    return positions.existing_path(error["loc"])


def _empty_keys(errors: Sequence[ErrorDetails], positions: Positions) -> set[Location]:
    """Find the keys that have nothing after them; one that is unknown, or a number, is told as that."""
    unknown = {error["loc"] for error in errors if error["type"] == "extra_forbidden"}
    return {
        location
        for location in positions.empty
        if isinstance(location[-1], str)
        and not any(location[: end + 1] in unknown for end in range(len(location)))
    }


def _explain_empty(location: Location, positions: Positions, schema: type[BaseModel]) -> Fault:
    way_out = "give a value" if _is_required(schema, location) else "give a value, or leave the key out"
    return positions.key(location), f"{dotted(location)}: nothing is written after it; {way_out}"


def _explain(details: ErrorDetails, positions: Positions, schema: type[BaseModel]) -> Fault:
    location = tuple(details["loc"])
    kind = details["type"]
    if kind == "extra_forbidden":
        name = str(location[-1])
        hint = suggest(name, _allowed(schema, location[:-1]))
        return positions.key(location), f"unknown key {dotted(location)!r}; {hint}"
    if kind == "missing":
        return positions.key(
            location[:-1]
        ), f"{dotted((*positions.existing_path(location), location[-1]))!r} is missing"
    text = details["msg"].removeprefix("Value error, ").removeprefix("Input ")
    name = dotted(positions.existing_path(location))
    input_value = details.get("input")
    if kind == "invalid_key" and isinstance(input_value, int):
        return positions.value(location), f"{name}: {input_value} stands where a key should; {DECIMAL_POINT}"
    if kind in ("model_type", "dict_type"):
        text = "should be keys with values (`key: value`)"
        text += ", not a list" if isinstance(input_value, list) else ""
    if kind != "value_error" and isinstance(input_value, str | int | float | bool | None):
        text += f", not {'empty' if input_value is None else repr(input_value)}"
    if location == ("format",) and (way_out := newer_format(input_value)):
        text += f"; {way_out}"
    if kind.startswith(("int", "float")) and (meant := number_meant(input_value)):
        text += f"; {meant}"
    return positions.value(location), f"{name}: {text}" if name else text


def _allowed(schema: type[BaseModel], location: Sequence[str | int]) -> list[str]:
    """Names of the fields that a mapping at `location` may have."""
    models = _models(schema, location)
    return sorted({field.alias or name for model in models for name, field in model.model_fields.items()})


def _is_required(schema: type[BaseModel], location: Location) -> bool:
    """Say whether a mapping must have the key at `location`."""
    return any(
        field.is_required()
        for model in _models(schema, location[:-1])
        for name, field in model.model_fields.items()
        if location[-1] in (name, field.alias)
    )


def _models(schema: type[BaseModel], location: Sequence[str | int]) -> list[type[BaseModel]]:
    """Give what may describe a mapping at `location`."""
    types_here: list[object] = [schema]
    for part in location:
        below = [inner for here in types_here for inner in _below(here, part)]
        types_here = below or types_here
    return [here for here in types_here if isinstance(here, type) and issubclass(here, BaseModel)]


def _below(annotation: object, part: str | int) -> list[object]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [
            inner
            for name, field in annotation.model_fields.items()
            if part in (name, field.alias)
            for inner in _alternatives(field.annotation)
        ]
    if get_origin(annotation) is not None:
        return [inner for argument in get_args(annotation)[-1:] for inner in _alternatives(argument)]
    return []


def _alternatives(annotation: object) -> list[object]:
    """Members of a union, without the metadata of Annotated."""
    origin = get_origin(annotation)
    if origin in (Union, types.UnionType):
        return [inner for argument in get_args(annotation) for inner in _alternatives(argument)]
    if hasattr(annotation, "__metadata__"):
        return _alternatives(get_args(annotation)[0])
    if origin is tuple:
        return [inner for argument in get_args(annotation) for inner in _alternatives(argument)]
    return [annotation]
