"""Laws of the effects, written apart from impactcell.physics, as the truth of tests.

One file holds one effect. `LIBRARY` has those of the vocabulary, `UNLISTED` those that no library of the
product knows, to see what is said of a gap that has no name.
"""

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from simulator.effects import unlisted
from simulator.effects.law import Effect, Parameter, Shot

__all__ = ["LIBRARY", "UNLISTED", "Effect", "Parameter", "Shot", "build"]


def _discover(package: str, path: Sequence[str]) -> Mapping[str, type[Effect]]:
    found: dict[str, type[Effect]] = {}
    for module in sorted(pkgutil.iter_modules(path), key=lambda entry: entry.name):
        if module.ispkg or module.name == "law":
            continue
        content = vars(importlib.import_module(f"{package}.{module.name}"))
        for value in content.values():
            if isinstance(value, type) and issubclass(value, Effect) and value is not Effect:
                found[value.identifier] = value
    return MappingProxyType(found)


UNLISTED = _discover(unlisted.__name__, unlisted.__path__)
LIBRARY = _discover(__name__, __path__)


def build(effects: Mapping[str, Mapping[str, Parameter]]) -> tuple[Effect, ...]:
    """Effects with their parameters, in the order given.

    Raises
    ------
    ValueError
        An identifier or parameter that is not known, or a parameter that is missing.
    """
    built = []
    for identifier, parameters in effects.items():
        kind = LIBRARY.get(identifier) or UNLISTED.get(identifier)
        if kind is None:
            message = f"unknown effect {identifier!r}; known: {', '.join([*LIBRARY, *UNLISTED])}"
            raise ValueError(message)
        if set(parameters) != set(kind.defaults):
            wanted = ", ".join(kind.defaults)
            message = (
                f"effect {identifier} has the parameters {wanted}; got {', '.join(parameters) or 'none'}"
            )
            raise ValueError(message)
        built.append(kind(**parameters))
    return tuple(built)
