"""Parameters for which a study gives two values: the outcome, and the model that is to be accepted.

Where something remains, the outcome is fitted beside a free form of it (`impactcell.discrepancy.laws`); the
extended model has no such form, and its effects take up a part of what remains.
"""

import math
from collections.abc import Mapping
from typing import Any


def differing_parameters(result: Mapping[str, Any], changes: Mapping[str, Any]) -> list[str]:
    """Name the parameters whose two intervals exclude each other beside what remains.

    Parameters
    ----------
    result : mapping
        `result.json` of the workflow.
    changes : mapping
        What accepting the model would change.
    """
    if (result.get("remaining") or {}).get("explained", True):
        return []
    stated = {
        f"{effect['effect']}.{name}": parameter
        for effect in result.get("effects", ())
        for name, parameter in effect["parameters"].items()
        if isinstance(parameter, Mapping)
    }
    return [
        change["parameter"]
        for change in changes.get("changes", ())
        if change["parameter"] in stated
        and _exclude(
            _intervals(stated[change["parameter"]]["value"], stated[change["parameter"]].get("ci95")),
            _intervals(change["after"], change.get("ci95")),
        )
    ]


def _intervals(value: Any, ends: Any) -> list[tuple[float, float]]:
    """Give the interval of each value: the value alone where it has none, endless where an end is open."""
    if not isinstance(value, list):
        value, ends = [value], [ends]
    return [
        (one, one)
        if not pair
        else (-math.inf if pair[0] is None else pair[0], math.inf if pair[1] is None else pair[1])
        for one, pair in zip(value, ends or [None] * len(value), strict=True)
        if one is not None
    ]


def _exclude(first: list[tuple[float, float]], second: list[tuple[float, float]]) -> bool:
    return any(
        max(low, other_low) > min(high, other_high)
        for (low, high), (other_low, other_high) in zip(first, second, strict=False)
    )
