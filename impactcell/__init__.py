"""impactcell: friction from taps, followed over wear, batch and stroke, and used to place parts.

The public API is what `__all__` lists: five functions and classes, and the types of their results.

======================  ==============================================================================
`simulate_tap`          one tap from first contact to rest, with its traces
`estimate`              mu_s and mu_k of one tap from its arrays
`track`                 wear, batch and alarms over a series of estimates
`TapPlanner`            which tap brings a part closer to its target
`discrepancy`           where model and measurement disagree, and which effect is missing
======================  ==============================================================================

All arguments and results are in SI units; names that are not carry their unit. Everything is looked up where
it is first asked for, so that `import impactcell` itself costs nothing.
"""

import os
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from impactcell.api.findings import DiscrepancyFindings, discrepancy
    from impactcell.api.friction import estimate
    from impactcell.api.series import track
    from impactcell.api.simulated_tap import SimulatedTap, simulate_tap
    from impactcell.cell.series_replay import TrackedSeries
    from impactcell.positioning import Tap, TapPlanner, Unreachable
    from impactcell.records import FrictionEstimate

__all__ = [
    "DiscrepancyFindings",
    "FrictionEstimate",
    "SimulatedTap",
    "Tap",
    "TapPlanner",
    "TrackedSeries",
    "Unreachable",
    "discrepancy",
    "estimate",
    "simulate_tap",
    "track",
]

_HOMES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "DiscrepancyFindings": "impactcell.api.findings",
        "FrictionEstimate": "impactcell.records",
        "SimulatedTap": "impactcell.api.simulated_tap",
        "Tap": "impactcell.positioning",
        "TapPlanner": "impactcell.positioning",
        "TrackedSeries": "impactcell.cell.series_replay",
        "Unreachable": "impactcell.positioning",
        "estimate": "impactcell.api.friction",
        "simulate_tap": "impactcell.api.simulated_tap",
        "track": "impactcell.api.series",
    }
)
"""Where each public name is defined. `discrepancy` is the room of that name, see `_Package`."""

# Matrices here have tens of rows, where a second BLAS thread costs ten times what it gives. Read by
# numpy when it is first imported; set the variable yourself to have it otherwise.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def __getattr__(name: str) -> Any:
    """Look a public name, or `__version__`, up where it is asked for."""
    if name == "discrepancy":
        return import_module("impactcell.discrepancy")
    if name == "__version__":
        from importlib.metadata import version

        return version("impactcell")
    if name not in _HOMES:
        raise AttributeError(f"module 'impactcell' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


class _DiscrepancyRoom(ModuleType):
    """The room `impactcell.discrepancy`, which can be called as the public function of the same name."""

    def __call__(self, *arguments: Any, **options: Any) -> "DiscrepancyFindings":
        return self.__wrapped__(*arguments, **options)

    @property
    def __wrapped__(self) -> "Callable[..., DiscrepancyFindings]":
        """The function itself: `help` and `inspect.signature` show it."""
        from impactcell.api.findings import discrepancy

        return discrepancy


class _Package(ModuleType):
    """The package itself: the import system sets its rooms as attributes, and one has a function's name."""

    def __setattr__(self, name: str, value: object) -> None:
        if name == "discrepancy" and isinstance(value, ModuleType):
            value.__class__ = _DiscrepancyRoom
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
