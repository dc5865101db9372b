"""The library of effects."""

import math

from generators.markdown import code
from impactcell.physics.effect import Effect
from impactcell.physics.effects import LIBRARY


def library() -> str:
    """Write a section an effect."""
    return "\n".join(_section(identifier, effect) for identifier, effect in sorted(LIBRARY.items()))


def _section(identifier: str, effect: Effect) -> str:
    parameters = [
        f"- {code(parameter.name)} [{parameter.unit}], {parameter.lower:g} to {parameter.upper:g}"
        + (
            f", {parameter.typical:g} where it is left out"
            if math.isnan(parameter.null)
            else f", vanishes at {parameter.null:g}"
        )
        for parameter in effect.parameters
    ]
    law = f"Acts on: {effect.kind.value}. Law: {code(effect.equation)}"
    return "\n".join((f"## {identifier}", "", law, "", *parameters, "", f"{effect.reference}.", ""))
