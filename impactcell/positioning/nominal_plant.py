"""The plant that a planner begins with, before its first tap."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from impactcell.errors import PositioningError
from impactcell.physics import Plant
from impactcell.positioning.planner_questions import is_number

NOMINAL: Final = Plant(stiffness_n_per_m=6.5e5, damping_n_s_per_m=465.0, mu_s=0.25, mu_k=0.19)
"""Where nothing is said. Of the two coefficients of friction one follows the other."""


def nominal_plant(given: Plant | Mapping[str, Any] | None) -> Plant:
    """Return the plant that is given, whole or by those of its fields that differ from `NOMINAL`.

    Raises
    ------
    PositioningError
        For what is no plant, a field that a plant does not have, a number that is none, or friction that is
        not positive.
    """
    plant = given if isinstance(given, Plant) else _from_fields({} if given is None else given)
    for name in ("mu_s", "mu_k"):
        if not getattr(plant, name) > 0.0:
            raise PositioningError(
                f"tap planner: plant: {name} must be positive, not {getattr(plant, name)}; "
                "without friction no part comes to rest"
            )
    return plant


def _from_fields(given: Mapping[str, Any]) -> Plant:
    if not isinstance(given, Mapping):
        raise PositioningError(f"tap planner: plant is a Plant, or some of its fields by name, not {given!r}")
    fields = dict(given)
    unknown = [name for name in fields if name not in Plant.__dataclass_fields__]
    if unknown:
        there = ", ".join(Plant.__dataclass_fields__)
        raise PositioningError(f"tap planner: plant has no field {unknown[0]!r}; there are {there}")
    for name, value in fields.items():
        if name != "effects" and not is_number(value):
            raise PositioningError(f"tap planner: plant: {name} must be a number, not {value!r}")
    ratio = NOMINAL.mu_k / NOMINAL.mu_s
    if "mu_s" in fields:
        fields.setdefault("mu_k", ratio * fields["mu_s"])
    elif "mu_k" in fields:
        fields["mu_s"] = fields["mu_k"] / ratio
    if fields.get("mu_k", 0.0) > fields.get("mu_s", math.inf):
        raise PositioningError(
            f"tap planner: plant: mu_k, {fields['mu_k']:g}, is above mu_s, {fields['mu_s']:g}; "
            "friction of a part at rest is no less than that of one that slides"
        )
    return replace(NOMINAL, **fields)
