"""The page on positioning names the registers, keys and reasons that the code has."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from impactcell.fieldbus.positioning_registers import COMMAND
from impactcell.fieldbus.register_map.map_registers import SHOWN
from impactcell.settings.positioning_section import PositioningSection
from impactcell.settings.sections import ActuatorSection

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "how-to" / "positioning.md").read_text(encoding="utf-8")
SOURCES = (
    *(ROOT / "impactcell" / "positioning").glob("*.py"),
    ROOT / "impactcell" / "service" / "positioning.py",
    ROOT / "impactcell" / "fieldbus" / "tap_commands.py",
)
"""Where a task can say why it ends."""


def rows(heading: str) -> list[list[str]]:
    """Cells of the rows of all tables below a heading, without their heads."""
    section = PAGE.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| `")]
    assert lines, heading
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]


def messages() -> Iterator[str]:
    """Every text of the sources, with `...` where a value is put in."""
    for source in SOURCES:
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = (part.value if isinstance(part, ast.Constant) else "..." for part in node.values)
                yield "".join(map(str, parts))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value


def test_every_register_of_positioning_is_told() -> None:
    told = {name for row in rows("The handshake with the PLC") for name in re.findall(r"`(\w+)`", row[0])}
    assert told == {*SHOWN, *COMMAND, "command_abort"}


def test_every_key_is_told_with_its_default() -> None:
    told = {
        name: default
        for names, _, defaults in rows("The cell file")
        for name, default in zip(re.findall(r"`([\w.]+)`", names), defaults.split(", "), strict=True)
    }
    of_section = {f"positioning.{key}" for key in PositioningSection.model_fields}
    assert of_section == {name for name in told if name.startswith("positioning.")}
    sections = {"positioning": PositioningSection(), "actuator": ActuatorSection()}
    for name, default in told.items():
        section, key = name.split(".")
        value = getattr(sections[section], key)
        shown = "none" if value is None else str(value).lower() if isinstance(value, bool) else f"{value:g}"
        assert default == shown, name


@pytest.mark.parametrize("quoted", [row[0] for row in rows("Faults")])
def test_every_reason_is_one_that_the_code_gives(quoted: str) -> None:
    for phrase in re.findall(r"`([^`]+)`", quoted):
        words = re.escape(phrase).replace(r"\.\.\.", ".*")
        pattern = re.compile(re.sub(r"\b(N|10|200)\b", r"\.\.\.", words).split(":")[0], re.DOTALL)
        assert any(pattern.search(message) for message in messages()), phrase
