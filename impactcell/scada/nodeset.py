"""The NodeSet2 file of the information model, written from the table of quantities and the alarm rules.

`python -m impactcell.scada.nodeset` writes it anew and says which numbers are free next; a test holds that
what lies in the tree is what would be written. Everything else that it says stands in its template beside it.
"""

import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, StrictUndefined

from impactcell.alarms import RULES
from impactcell.quantities import CYCLE, FOLDERS, MODULE
from impactcell.records.quantity import Quantity, Ranges, Unit

MODEL_FILE: Final = Path(__file__).parent / "model" / "ImpactCell.NodeSet2.xml"
_NODE: Final = re.compile(
    r'NodeId="ns=1;i=(\d+)" BrowseName="(?:\d:)?(\w+)"(?: ParentNodeId="ns=1;i=(\d+)")?'
)
"""Number, name and number of the parent of a node, as the template writes them."""


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
    """Write the NodeSet2 file.

    Raises
    ------
    ValueError
        A number is taken twice.
    """
    environment = Environment(
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
        autoescape=True,
    )
    template = MODEL_FILE.with_name(f"{MODEL_FILE.name}.j2").read_text(encoding="utf-8")
    text = environment.from_string(template).render(folders=list(_folders()), conditions=RULES.values())
    for number, (name, *others) in _names(text).items():
        if others:
            raise ValueError(
                f"{number} is taken by {name} and by {others[0]}: give the new one another where it is "
                f"written, a value in impactcell/quantities.py, a condition in impactcell/alarms/rules, all "
                f"else in {MODEL_FILE.name}.j2; the next free number is {next_free(text, number)}"
            )
    return text


def next_free(text: str, number: int) -> int:
    """Give the number after the last one in the thousand of another."""
    return 1 + max(other for other in _names(text) if other // 1000 == number // 1000)


def _names(text: str) -> dict[int, list[str]]:
    """Names of the nodes of each number; one whose parent is known has the parent's name before its own."""
    names: dict[int, list[str]] = defaultdict(list)
    for number, name, parent in _NODE.findall(text):
        before = names[int(parent)][0] + "/" if parent and int(parent) in names else ""
        names[int(number)].append(before + name)
    return names


def _main() -> None:
    try:
        text = nodeset()
    except ValueError as error:
        sys.exit(str(error))
    MODEL_FILE.write_text(text, encoding="utf-8")
    free = (next_free(text, number) for number in (6000, 5000, 1000))
    sys.stdout.write("free next: {} for a value, {} for a condition, {} for its type\n".format(*free))


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
    _main()
