"""The library of physical effects: one file is one named effect.

A file of this package defines one `EFFECT`, of the same name; that file is all it takes for the effect to be
simulated, fitted and offered everywhere. Effects from outside of the package join by `offer_effect`
(`impactcell.physics.outside_effects` loads them), and by entry points of the group "impactcell.effects".
"""

import importlib
import pkgutil
from collections.abc import Mapping
from types import MappingProxyType

from impactcell.errors import PhysicsError
from impactcell.physics.effect import Effect


def _discover() -> dict[str, Effect]:
    library: dict[str, Effect] = {}
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda module: module.name):
        effect = importlib.import_module(f"{__name__}.{module.name}").EFFECT
        if effect.identifier != module.name:
            raise PhysicsError(f"effects/{module.name}.py calls its effect {effect.identifier!r}")
        library[effect.identifier] = effect
    return library


_OFFERED: dict[str, Effect] = _discover()
"""What `LIBRARY` shows."""
LIBRARY: Mapping[str, Effect] = MappingProxyType(_OFFERED)
"""Every effect that is offered, by its identifier: those of the product, and what joined them from
outside."""

OF_PRODUCT = frozenset(_OFFERED)
"""Identifiers of the effects of this package: no others are there before one joins from outside."""

_ADDED: dict[str, Effect] = {}
"""Effects that joined while running: free-form terms and laws that nobody had listed."""


def offer_effect(effect: Effect) -> None:
    """Let an effect from outside be simulated, fitted and named like those of the product.

    Raises
    ------
    PhysicsError
        Another effect has this identifier.
    """
    if effect.identifier in _OFFERED or effect.identifier in _ADDED:
        raise PhysicsError(
            f"an effect called {effect.identifier!r} is there already; give yours another name"
        )
    _OFFERED[effect.identifier] = effect


def withdraw_effect(identifier: str) -> None:
    """Take back what `offer_effect` has offered."""
    _OFFERED.pop(identifier, None)


def add_effect(effect: Effect) -> None:
    """Let plants and fits use an effect that the library does not have; it is never offered by itself.

    Raises
    ------
    PhysicsError
        Another effect has this identifier: what was worked out with it would change its meaning.
    """
    known = LIBRARY.get(effect.identifier) or _ADDED.get(effect.identifier)
    if known is not None and known is not effect:
        raise PhysicsError(
            f"an effect called {effect.identifier!r} is there already; give yours another name"
        )
    _ADDED[effect.identifier] = effect


def find_effect(identifier: str) -> Effect:
    """Look an effect up, of the library or added; raises `PhysicsError` with what there is."""
    effect = LIBRARY.get(identifier) or _ADDED.get(identifier)
    if effect is None:
        raise PhysicsError(f"no effect is called {identifier!r}; there are {', '.join((*LIBRARY, *_ADDED))}")
    return effect
