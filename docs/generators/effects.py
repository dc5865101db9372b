"""The library of effects."""

import math

from generators.markdown import code, table
from impactcell.physics.effects import LIBRARY


def library() -> str:
    """Write a row an effect."""
    rows = []
    for identifier, effect in sorted(LIBRARY.items()):
        parameters = "; ".join(
            f"{code(parameter.name)} [{parameter.unit}], {parameter.lower:g} to {parameter.upper:g}"
            + ("" if math.isnan(parameter.null) else f", vanishes at {parameter.null:g}")
            for parameter in effect.parameters
        )
        rows.append(
            (code(identifier), effect.kind.value, code(effect.equation), parameters, effect.reference)
        )
    return table(("effect", "acts on", "law", "parameters", "reference"), rows)
