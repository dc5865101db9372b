"""Which published values the page of a cell lists, and how it writes them: all that the table has."""

from dataclasses import dataclass
from typing import Any

from impactcell.quantities import CYCLE, MODULE, ONE
from impactcell.records.quantity import DataType, Quantity, Ranges
from impactcell.web.texts import LANGUAGES

STD_SUFFIX = "StdDev"
"""Ends the path of a value's standard deviation, which is written behind that value, with ±."""


@dataclass(frozen=True, slots=True)
class ListedValue:
    """A published value on the page.

    `form` is `coefficient`, `count`, `cycle` (0: none), `cycles` (whole ones), `band` (what is told of a
    standard deviation that stands by itself), or empty.
    """

    path: str
    title: str
    unit: str
    form: str


def listed_values(language: str) -> dict[str, list[ListedValue]]:
    """List what can be shown in one line, by folder, in the order of the table.

    >>> next(value.title for value in listed_values("de")["Model"] if value.path == "Model/Gap")
    'Abweichung'
    """
    index = list(LANGUAGES).index(language)
    listed: dict[str, list[ListedValue]] = {}
    quantities: tuple[Quantity[Any], ...] = (*CYCLE, *MODULE)
    paths = {quantity.path for quantity in quantities}
    for quantity in quantities:
        is_std = quantity.path.endswith(STD_SUFFIX) and quantity.path.removesuffix(STD_SUFFIX) in paths
        if quantity.is_array or is_std:
            continue
        unit = quantity.unit.symbol if quantity.unit is not None else ""
        value = ListedValue(quantity.path, quantity.title[index], unit, _form(quantity))
        listed.setdefault(quantity.path.partition("/")[0], []).append(value)
    return listed


def _form(quantity: Quantity[Any]) -> str:
    if quantity.data_type is DataType.UINT32:
        return "cycle" if quantity.path.endswith("Cycle") else "count"
    if quantity.path.endswith(STD_SUFFIX):
        return "band"
    if quantity.path.startswith("Wear/CyclesToLimit"):
        return "cycles"
    bounds = quantity.node_range(Ranges())
    is_coefficient = quantity.unit is ONE and bounds is not None and bounds[1] <= Ranges().friction
    return "coefficient" if is_coefficient else ""
