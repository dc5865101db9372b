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

__all__ = ["LIBRARY", "UNLISTED", "Effect", "Parameter", "Shot", "build", "check"]


def _discover(package: str, path: Sequence[str]) -> Mapping[str, type[Effect]]:
    library: dict[str, type[Effect]] = {}
    for module in sorted(pkgutil.iter_modules(path), key=lambda entry: entry.name):
        if module.ispkg or module.name == "law":
            continue
        content = vars(importlib.import_module(f"{package}.{module.name}"))
        for value in content.values():
            if isinstance(value, type) and issubclass(value, Effect) and value is not Effect:
                if value.identifier != module.name:
                    raise ValueError(f"effects/{module.name}.py calls its effect {value.identifier!r}")
                library[value.identifier] = value
    return MappingProxyType(library)


UNLISTED = _discover(unlisted.__name__, unlisted.__path__)
LIBRARY = _discover(__name__, __path__)


def check(identifier: str, parameters: Mapping[str, Parameter]) -> type[Effect]:
    """Return the law of an effect with these parameters.

    Raises
    ------
    ValueError
        An identifier or parameter that is not known, a parameter that is missing, or a value that the law
        cannot have.
    """
    kind = LIBRARY.get(identifier) or UNLISTED.get(identifier)
    if kind is None:
        message = f"unknown effect {identifier!r}; known: {', '.join([*LIBRARY, *UNLISTED])}"
        raise ValueError(message)
    for name in parameters:
        if name not in kind.defaults:
            message = f"{identifier} has no parameter {name!r}; it has {', '.join(kind.defaults)}"
            raise ValueError(message)
    for name, default in kind.defaults.items():
        if name not in parameters:
            message = f"{identifier} needs its parameter {name}"
            raise ValueError(message)
        value = parameters[name]
        if isinstance(value, int | float) == isinstance(default, Sequence):
            wanted = (
                "a list with one number a batch after the first"
                if isinstance(default, Sequence)
                else "one number"
            )
            message = f"{identifier}: {name} has to be {wanted}"
            raise ValueError(message)
        if name in kind.positive and not (isinstance(value, int | float) and value > 0.0):
            message = f"{identifier}: {name} has to be above 0"
            raise ValueError(message)
    return kind


def build(effects: Mapping[str, Mapping[str, Parameter]]) -> tuple[Effect, ...]:
    """Effects with their parameters, in the order given; ValueError as `check`."""
    return tuple(check(identifier, parameters)(**parameters) for identifier, parameters in effects.items())
