"""Pages and tables that are made from the code itself, so that they cannot differ from it."""

from pathlib import Path

from generators import (
    alarms,
    architecture,
    cell_file,
    command_line,
    effects,
    nodes,
    register_map,
    rooms,
    structure,
)

PAGES = {
    "alarms.md": alarms.rules,
    "architecture.svg": architecture.drawing,
    "cell_file.md": cell_file.sections,
    "command_line.md": command_line.verbs,
    "effects.md": effects.library,
    "nodes.md": nodes.variables,
    "register_map.md": register_map.keys,
    "rooms.md": rooms.tables,
    "structure.md": structure.measured,
}
"""Each fragment, and the function that makes its text."""


def write_pages(directory: Path) -> None:
    """Write every fragment; one that has not changed is left as it is, so that nothing is built in vain."""
    directory.mkdir(exist_ok=True)
    for name, make in PAGES.items():
        page, text = directory / name, make()
        if not page.is_file() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")
