"""What a map file may say of a register, and the layout that comes with the product."""

from pathlib import Path

import yaml

from generators.markdown import code, table
from impactcell.fieldbus.map_registers import REQUIRED
from impactcell.fieldbus.map_validation import _KEYS
from impactcell.fieldbus.register import KINDS, SI_FACTOR

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ROOT / "config" / "maps" / "fpga-v1.yaml"


def keys() -> str:
    """Write the keys of an entry, the units, and the shipped map register by register."""
    entry = table(("key", "must be"), [(code(key), rule) for key, (rule, _) in _KEYS.items()])
    shipped = yaml.safe_load(SHIPPED.read_text(encoding="utf-8"))["registers"]
    rows = [
        (
            code(name),
            str(register["address"]),
            register["type"] + (f" × {register['count']}" if register.get("count", 1) > 1 else ""),
            register.get("unit", ""),
            "yes" if register.get("writable") else "",
            register.get("description", ""),
        )
        for name, register in shipped.items()
    ]
    return "\n\n".join(
        [
            "## Keys of an entry",
            entry,
            f"Types: {', '.join(map(code, (*KINDS, 'string')))}. Units: {', '.join(map(code, SI_FACTOR))}.",
            "## What is required, and why",
            table(("register", "what it proves or gives"), [(code(n), why) for n, why in REQUIRED.items()]),
            "## The layout `fpga-v1`",
            table(("register", "address", "type", "unit", "writable", "meaning"), rows),
        ]
    )
