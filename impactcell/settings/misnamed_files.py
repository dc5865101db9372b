"""A file that a cell file names as what it is not: the cell file is at fault, that one is well as it is."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from impactcell.errors import SettingsError
from impactcell.process import yaml_loader
from impactcell.process.file_format import newer_file

MAP: Final = "a register map"
MODEL: Final = "a model"
_KINDS: Final = {
    "cell": "a cell file",
    "registers": MAP,
    "plant": MODEL,
    "sensors": "the head of a campaign",
    "coordinate": "a base model",
}
"""Kinds of files by a key that each has, and none of those below it."""


def why_unusable(file: Path, kind: str) -> str:
    """Say why a file cannot be read as one of a kind, whatever stands in it; nothing where it could be."""
    try:
        content, _ = yaml_loader.load(file)
    except SettingsError:
        return ""
    if not isinstance(content, Mapping):
        return ""
    actual = next((kind for key, kind in _KINDS.items() if key in content), kind)
    if actual != kind:
        return f"{file} is {actual}, not {kind}"
    is_newer = newer_file(content.get("format"))
    return f"{file} {is_newer}" if is_newer else ""
