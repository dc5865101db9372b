"""The library of physical effects: one file is one named effect.

A file of this package defines one `EFFECT`, of the same name; that file is all it takes for the effect to be
simulated, fitted and offered everywhere.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from types import MappingProxyType

from impactcell.errors import PhysicsError
from impactcell.physics.effect import Effect


def _discover() -> Mapping[str, Effect]:
    library: dict[str, Effect] = {}
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda module: module.name):
        effect = importlib.import_module(f"{__name__}.{module.name}").EFFECT
        if effect.identifier != module.name:
            raise PhysicsError(f"effects/{module.name}.py calls its effect {effect.identifier!r}")
        library[effect.identifier] = effect
    return MappingProxyType(library)


LIBRARY: Mapping[str, Effect] = _discover()
"""Every effect by its identifier."""
