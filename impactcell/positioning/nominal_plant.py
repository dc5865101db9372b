"""The plant that a planner begins with, before its first tap."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from impactcell.errors import PositioningError
from impactcell.physics import Plant

NOMINAL: Final = Plant(stiffness_n_per_m=6.5e5, damping_n_s_per_m=465.0, mu_s=0.25, mu_k=0.19)
"""Where nothing is said. Of the two coefficients of friction one follows the other."""


def nominal_plant(given: Plant | Mapping[str, Any] | None) -> Plant:
    """Return the plant that is given, whole or by those of its fields that differ from `NOMINAL`.

    Raises
    ------
    PositioningError
        For a field that a plant does not have.
    """
    if isinstance(given, Plant):
        return given
    fields = dict(given or {})
    unknown = [name for name in fields if name not in Plant.__dataclass_fields__]
    if unknown:
        there = ", ".join(Plant.__dataclass_fields__)
        raise PositioningError(f"tap planner: plant has no field {unknown[0]!r}; there are {there}")
    ratio = NOMINAL.mu_k / NOMINAL.mu_s
    if "mu_s" in fields:
        fields.setdefault("mu_k", ratio * fields["mu_s"])
    elif "mu_k" in fields:
        fields["mu_s"] = fields["mu_k"] / ratio
    return replace(NOMINAL, **fields)
