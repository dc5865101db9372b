"""Which other cells run with a cell's model file: whatever is put into its place, they run with it too."""

import re
from pathlib import Path
from typing import Final

from impactcell.errors import SettingsError
from impactcell.physics.outside_effects import source_of
from impactcell.prediction import Model
from impactcell.process import yaml_loader
from impactcell.process.console import print_note
from impactcell.settings import CellConfig

CELL_KEYS: Final = (re.compile(r"^cell:", re.MULTILINE), re.compile(r"^model:", re.MULTILINE))
"""What a cell file has among its keys: register maps and models, which may be long, are not read."""


def cells_sharing(config: CellConfig) -> tuple[str, ...]:
    """Name the cells whose files lie beside that of a cell and name the same model file."""
    names: dict[str, None] = {}
    here, model = config.path.resolve(), config.settings.model.resolve()
    for file in sorted((*here.parent.glob("*.yaml"), *here.parent.glob("*.yml"))):
        if file.resolve() == here:
            continue
        try:
            text = file.read_text(encoding="utf-8")
            if not all(key.search(text) for key in CELL_KEYS):
                continue
            content, _ = yaml_loader.load(file)
        except (OSError, UnicodeDecodeError, SettingsError):
            continue  # it is no cell that runs
        other, named = (content.get(key) if isinstance(content, dict) else None for key in ("cell", "model"))
        if isinstance(named, str) and (file.parent / Path(named).expanduser()).resolve() == model:
            names.setdefault(str(other))
    return tuple(names)


def note_sharing(config: CellConfig, model: Model, sharing: tuple[str, ...]) -> None:
    """Say whose model has changed too, and what the model needs that does not lie beside it."""
    target = config.settings.model
    if sharing:
        print_note(
            f"{target} is the model file of {', '.join(sharing)} too: they run with {model.name} as well; to "
            f"keep them apart, name another `model` in {config.path}"
        )
    sources = [source for effect in model.plant.effects if (source := source_of(effect)) is not None]
    for source in sources:
        if source.parent != target.resolve().parent:
            print_note(f"{target} needs {source}: keep that file there, or the cell cannot be read any more")
