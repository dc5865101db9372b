"""Faults of files that are imported, told together."""

from collections.abc import Sequence

from impactcell.errors import MeasurementError

MAX_FAULTS_TOLD = 10
"""Faults told of one import."""


def raise_faults(faults: Sequence[str]) -> None:
    """Raise `MeasurementError` with the first faults, a line each, and how many more there are; if any."""
    if not faults:
        return
    rest = len(faults) - MAX_FAULTS_TOLD
    more = [f"and {rest} more faults"] if rest > 0 else []
    raise MeasurementError("\n".join([*faults[:MAX_FAULTS_TOLD], *more]))
