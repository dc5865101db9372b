"""YAML with positions: read a file so that every fault can be told as `file:line:column: message`.

Scalars follow the core schema of YAML 1.2: `1e-6` is a number, `on` and `2026-01-01` are text, `010` is ten.
PyYAML alone follows 1.1, where each of these surprises.
"""

import difflib
import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import yaml

from impactcell.errors import SettingsError
from impactcell.process.yaml_core_schema import CoreConstructor, compose, integer

Location = tuple[str | int, ...]

MOST_BYTES = 10_000_000
"""Of one file; a map of every register there can be has 6 MB."""
MOST_NODES = 200_000
"""A file of nested aliases or merges can describe more than memory holds; no honest one comes near this."""


NULL: Final = "tag:yaml.org,2002:null"
"""What an empty value is read as."""

_WAYS_OUT: Final = {
    "found character '\\t' that cannot start any token": "a tab; YAML is indented with spaces",
    "mapping values are not allowed here": (
        "a second `:` where none is expected: indent the line as its neighbours, "
        "put a text with `: ` in quotes"
    ),
}
"""What the parser finds, in words that name the way out."""
_OUT_OF_PLACE: Final = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ud800-\udfff]")
"""Control characters, but those that a text of several lines may have, and halves of characters."""


@dataclass(frozen=True, slots=True)
class FilePosition:
    """Where something stands in a file; both counted from 1, printed as `line:column`."""

    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.line}:{self.column}"


@dataclass(frozen=True, slots=True)
class Positions:
    """Where each key and each value of a YAML file stands, by its path of keys and indices.

    Attributes
    ----------
    keys, values : mapping
    empty : frozenset
        Keys with nothing after them, which YAML reads as null; not those with `null` or `~`.
    """

    keys: Mapping[Location, FilePosition]
    values: Mapping[Location, FilePosition]
    empty: frozenset[Location] = frozenset()

    def existing_path(self, location: Sequence[str | int]) -> Location:
        """Give the part of `location` that the file has, leaving out tags that only a schema knows."""
        path: Location = ()
        for part in location:
            if (*path, part) in self.values:
                path = (*path, part)
        return path

    def value(self, location: Sequence[str | int]) -> FilePosition:
        """Place of the value at `location`, or of the nearest enclosing one."""
        return self.values[self.existing_path(location)]

    def key(self, location: Sequence[str | int]) -> FilePosition:
        """Place of the key at `location`, or of the nearest enclosing one."""
        path = self.existing_path(location)
        return self.keys.get(path, self.values[path])


def load(path: Path) -> tuple[object, Positions]:
    """Read one YAML document.

    Returns
    -------
    data : object
        As `yaml.safe_load` would give it, but with the scalars of YAML 1.2.
    positions : Positions

    Raises
    ------
    SettingsError
        The file cannot be read, is empty, is not UTF-8 or not YAML, repeats a key or contains itself.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise SettingsError(f"{path}: has more than {MOST_BYTES} bytes, so it is no file of settings")
        text = content.decode("utf-8-sig")
    except OSError as fault:
        raise SettingsError(f"{path}: cannot be read: {fault.strerror}") from fault
    except UnicodeDecodeError as fault:
        place, byte = _end_of(fault.object[: fault.start].decode()), fault.object[fault.start]
        message = f"is not UTF-8 text (byte 0x{byte:02X} here); save it as UTF-8"
        raise SettingsError(format_error(path, place, message)) from fault
    try:
        node = compose(text)
        if node is None:
            raise SettingsError(f"{path}:1:1: the file is empty")
        positions = _positions(path, node)
        return CoreConstructor().construct_document(node), positions
    except yaml.MarkedYAMLError as fault:
        mark = fault.problem_mark or fault.context_mark
        place = FilePosition(mark.line + 1, mark.column + 1) if mark else FilePosition(1, 1)
        context = f" ({fault.context})" if fault.context else ""
        told = _WAYS_OUT.get(str(fault.problem), f"{fault.problem}{context}")
        raise SettingsError(f"{path}:{place}: {told}") from fault
    except yaml.reader.ReaderError as fault:
        place = _end_of(text[: fault.position])
        raise SettingsError(f"{path}:{place}: a character YAML does not allow ({fault.reason})") from fault
    except RecursionError as fault:
        raise SettingsError(f"{path}:1:1: nested too deeply") from fault
    except ValueError as fault:
        raise SettingsError(f"{path}:1:1: {fault}") from fault


def _end_of(text: str) -> FilePosition:
    """Place behind a text that a file begins with."""
    return FilePosition(text.count("\n") + 1, len(text) - text.rfind("\n"))


def _positions(path: Path, root: yaml.Node) -> Positions:
    keys: dict[Location, FilePosition] = {}
    values: dict[Location, FilePosition] = {}
    is_empty: dict[Location, bool] = {}
    visits = itertools.count(1)

    def visit(node: yaml.Node, location: Location, above: tuple[yaml.Node, ...]) -> None:
        place = FilePosition(node.start_mark.line + 1, node.start_mark.column + 1)
        if node in above:
            raise SettingsError(f"{path}:{place}: this part of the file contains itself")
        values[location] = place
        if isinstance(node, yaml.ScalarNode):
            _check_characters(path, place, location, node.value)
        if next(visits) > MOST_NODES:
            raise SettingsError(f"{path}:{place}: aliases describe more than {MOST_NODES} values")
        within = (*above, node)
        if isinstance(node, yaml.SequenceNode):
            for index, item in enumerate(node.value):
                visit(item, (*location, index), within)
        elif isinstance(node, yaml.MappingNode):
            merged = [pair for pair in node.value if pair[0].tag == "tag:yaml.org,2002:merge"]
            for _, source in merged:
                for part in source.value if isinstance(source, yaml.SequenceNode) else [source]:
                    visit(part, location, within)
            values[location] = place
            for key_node, value_node in node.value:
                if isinstance(key_node, yaml.ScalarNode) and (key_node, value_node) not in merged:
                    key: str | int = key_node.value
                    if key_node.tag == "tag:yaml.org,2002:int":
                        with suppress(ValueError):  # what is no number is told when it is built
                            key = integer(key_node.value)
                    here = (*location, key)
                    keys[here] = FilePosition(key_node.start_mark.line + 1, key_node.start_mark.column + 1)
                    _check_characters(path, keys[here], location, key_node.value)
                    start, end = value_node.start_mark.index, value_node.end_mark.index
                    is_empty[here] = value_node.tag == NULL and start == end
                    visit(value_node, here, within)

    visit(root, (), ())
    return Positions(keys, values, frozenset(here for here, empty in is_empty.items() if empty))


def _check_characters(path: Path, place: FilePosition, location: Location, text: str) -> None:
    """Refuse what an escape can bring in, and no name, path or text has: it fails far from here."""
    found = _OUT_OF_PLACE.search(text)
    if found:
        message = f"has the character U+{ord(found[0]):04X}, which no name, path or text has; take it out"
        name = dotted(location)
        raise SettingsError(format_error(path, place, f"{name}: {message}" if name else message))


def format_error(path: Path, place: FilePosition, message: str) -> str:
    """One fault in the form every fault takes: `file:line:column: message`."""
    return f"{path}:{place}: {message}"


def suggest(name: str, allowed: Iterable[str]) -> str:
    """Suggest what `name` may have meant: the nearest of `allowed`, or all of it."""
    names = sorted(allowed)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    return f"did you mean {near[0]!r}?" if near else f"allowed here: {', '.join(names)}"


def dotted(location: Sequence[str | int]) -> str:
    """Write a path of keys and indices as people do, as in `sensors.force[2]`."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text
