"""The NodeSet2 file of the information model, written from the table of quantities and the alarm rules.

`python -m impactcell.scada.nodeset` writes it anew; a test holds that what lies in the tree is what would be
written. Everything else that it says stands in its template beside it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, StrictUndefined

from impactcell.alarms import RULES
from impactcell.quantities import CYCLE, FOLDERS, MODULE
from impactcell.records.quantity import Quantity, Ranges, Unit

MODEL_FILE: Final = Path(__file__).parent / "model" / "ImpactCell.NodeSet2.xml"


@dataclass(frozen=True, slots=True)
class _Variable:
    name: str
    number: int
    description: str
    data_type: str
    is_array: bool
    has_history: bool
    unit: Unit | None
    unit_id: int
    low: str
    high: str


@dataclass(frozen=True, slots=True)
class _Folder:
    name: str
    number: int
    description: str
    variables: tuple[_Variable, ...]


def unit_id(code: str) -> int:
    """Give the number by which OPC UA knows a UNECE code (Part 8, 5.6.4.3).

    >>> unit_id("C62")
    4404786
    """
    return int.from_bytes(code.encode("ascii"), "big")


def nodeset() -> str:
    """Write the NodeSet2 file."""
    environment = Environment(
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
        autoescape=True,
    )
    template = MODEL_FILE.with_name(f"{MODEL_FILE.name}.j2").read_text(encoding="utf-8")
    return environment.from_string(template).render(folders=list(_folders()), conditions=RULES.values())


def _folders() -> Iterator[_Folder]:
    quantities: tuple[Quantity[Any], ...] = (*CYCLE, *MODULE)
    for name, (number, description) in FOLDERS.items():
        variables = tuple(_variable(q) for q in quantities if q.path.partition("/")[0] == name)
        yield _Folder(name, number, description, variables)


def _variable(quantity: Quantity[Any]) -> _Variable:
    low, high = quantity.node_range(Ranges()) or (0.0, 0.0)
    return _Variable(
        quantity.path.partition("/")[2],
        quantity.number,
        quantity.description,
        quantity.data_type.value,
        quantity.is_array,
        quantity.has_history,
        quantity.unit,
        unit_id(quantity.unit.code) if quantity.unit is not None else 0,
        f"{low:.15g}",
        f"{high:.15g}",
    )


if __name__ == "__main__":
    MODEL_FILE.write_text(nodeset(), encoding="utf-8")
