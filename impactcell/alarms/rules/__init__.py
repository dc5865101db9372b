"""The alarm rules, one file each: a new one is a file here that holds a `RULE`.

`RULES` has all of them by name, in the order in which conditions are listed.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from types import MappingProxyType

from impactcell.alarms.rule import AlarmRule


def _load() -> Mapping[str, AlarmRule]:
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    rules = sorted((module.RULE for module in modules), key=lambda rule: rule.node_number)
    return MappingProxyType({rule.name: rule for rule in rules})


RULES: Mapping[str, AlarmRule] = _load()
"""All rules by name."""
