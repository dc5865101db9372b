"""By how much a model that runs by itself is off what was held out."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OpenLoopError:
    """Error of a simulation over all held-out stretches.

    Attributes
    ----------
    rmse : float
        [m, rad, N or N m].
    fit_percent : float
        100 (1 - rmse / standard deviation of what was measured), of a position about each stretch's own mean.
    relative_force : float
        rmse over the RMS of the measured force; nan where the position is predicted.
    """

    rmse: float
    fit_percent: float
    relative_force: float


@dataclass(frozen=True, slots=True)
class BetterSimulation:
    """Terms with which the simulation of what was held out errs far less.

    Attributes
    ----------
    names : tuple of str
        Of the terms, one of which is enough; that with which it errs least comes first.
    rmse : float
        With the first [m or rad].
    """

    names: tuple[str, ...]
    rmse: float
