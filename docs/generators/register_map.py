"""What a map file may say of a register, and the layout that comes with the product."""

from pathlib import Path
from typing import Any

import yaml

from generators.markdown import code, table
from impactcell.fieldbus.cycles.status_block import _BATCH
from impactcell.fieldbus.map_promises import not_promised
from impactcell.fieldbus.positioning_registers import COMMAND, SHOWN
from impactcell.fieldbus.register_map.map_registers import CONSTANTS, MEASURED, NEEDED_BY, REQUIRED
from impactcell.fieldbus.register_map.map_validation import _KEYS
from impactcell.fieldbus.register_map.register_types import KINDS, SI_FACTOR
from impactcell.fieldbus.registers import RegisterMap

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ROOT / "config" / "maps" / "fpga-v1.yaml"
IN_COLUMNS = ("address", "type", "count", "length", "unit", "writable", "description")
"""Keys of an entry that have a column of their own."""
WORDS = """\
Names in `codes` that are compared word for word: `ready` of `positioning_state`, `executing` and `done` of
`command_result`. [What each register has to do](../how-to/positioning.md)."""


def keys() -> str:
    """Write the keys of an entry, the units, and the shipped map register by register."""
    entry = table(("key", "must be"), [(code(key), rule) for key, (rule, _) in _KEYS.items()])
    shipped = yaml.safe_load(SHIPPED.read_text(encoding="utf-8"))["registers"]
    rows = [
        (
            code(name),
            str(register["address"]),
            register.get("description", ""),
            _type(register),
            _further(register),
        )
        for name, register in shipped.items()
    ]
    constants = ", ".join(map(code, CONSTANTS))
    return "\n\n".join(
        [
            "## Keys of an entry",
            entry,
            f"Types: {', '.join(map(code, (*KINDS, 'string')))}. Units: {', '.join(map(code, SI_FACTOR))}.",
            f"With `value` (and `unit`) in its place, what is always the same: {constants}.",
            "## What is required, and why",
            table(("register", "what it proves or gives"), _required()),
            "## What works only together",
            table(("for", "registers, all of them"), _together()),
            WORDS,
            "## What is then not promised",
            "As `impactcell check`, `impactcell probe` and the log say it of the maps of poorer modules:",
            table(("map", "not promised"), _promises()),
            "## The layout `fpga-v1`",
            table(("register", "address", "meaning", "type and unit", "further keys"), rows),
        ]
    )


def _type(register: dict[str, Any]) -> str:
    """Say the type, how many values or registers there are of it, its unit, and whether it is written."""
    told = register["type"] + (f" × {register['count']}" if register.get("count", 1) > 1 else "")
    told += f", {register['length']} registers" if "length" in register else ""
    told += f", {register['unit']}" if "unit" in register else ""
    return told + (", writable" if register.get("writable") else "")


def _further(register: dict[str, Any]) -> str:
    """Give what else the map says of a register."""
    said = []
    for key, value in register.items():
        if isinstance(value, dict):
            said.append(f"{key}: " + ", ".join(f"{code_} {name}" for code_, name in value.items()))
        elif key not in IN_COLUMNS:
            said.append(f"{key}: {value}")
    return "; ".join(said)


def _together() -> list[tuple[str, str]]:
    """Say which registers are of no use without each other."""
    groups = {
        "batches that the PLC announces": _BATCH,
        "positioning": (*SHOWN, *COMMAND),
        "stopping the tap that is under way": ("command_abort",),
    }
    return [(purpose, ", ".join(map(code, names))) for purpose, names in groups.items()]


def _required() -> list[tuple[str, str]]:
    """Say what any map has, and what it has beside some registers."""
    rows = [(code(name), why) for name, why in REQUIRED.items()]
    rows.append((" or ".join(map(code, MEASURED)), "friction"))
    for name, needs in NEEDED_BY.items():
        rows += [(f"beside {code(name)}: {' or '.join(map(code, each))}", why) for each, why in needs]
    return rows


def _promises() -> list[tuple[str, str]]:
    """Say what the maps of poorer modules do not promise."""
    rows = []
    for file in sorted(SHIPPED.parent.glob("*.yaml")):
        register_map = RegisterMap.from_mapping(yaml.safe_load(file.read_text(encoding="utf-8")))
        rows += [(code(register_map.name), text) for text in not_promised(register_map)]
    return rows
