"""What a fault of a sensor would explain where a base model says nothing of it: a late force, a bent angle.

A force that was recorded late or early looks like its own derivative, an encoder that turns off its centre
like a wave of the angle. Either is a column of the regression, and is held against what would be named.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine.base_model import BaseModel
from impactcell.discrepancy.machine.regression import fit_blocks
from impactcell.discrepancy.machine.selection import MIN_GAIN_Z, MIN_SHARE, SelectionStep
from impactcell.discrepancy.machine.ties import MIN_TIED_SHARE, TIE_Z
from impactcell.discrepancy.machine.trials import TermSearch, mean_over_error
from impactcell.discrepancy.machine.weak_form import ECCENTRICITY, Column

DELAY: Column = ("delay_s", 0.0, 0)
"""Column of how late the force was recorded: the force's derivative."""
OFF_CENTRE: tuple[Column, ...] = tuple((ECCENTRICITY, 0.0, number) for number in range(2))
"""Columns of an encoder off its centre: cosine and sine of the angle."""
MOST = 0.5
"""Share of what remains from which on a sensor's fault is what the headline tells [1]."""
FARTHEST_OFF_RAD = 0.05
"""Error of an angle, three degrees, beyond which no encoder that anybody uses turns off its centre."""
AS_LATE = "a force recorded late or early by less than a sample would explain as much as the best term"
"""Why the best term is not taken where the delay is not known so well."""
AS_BENT = "an encoder that turns off its centre would explain as much as the best term"
"""Why the best term is not taken where nobody says that the encoder turns in its centre."""


@dataclass(frozen=True, slots=True)
class SensorFault:
    """A fault that a base model could have among its nuisances, and holds at none.

    Attributes
    ----------
    columns : tuple of Column
    largest : float
        Size up to which nobody can exclude it who has not stated it [s or rad].
    as_well : str
        Why a term is not taken that explains no more.
    words : callable
        Words for what its coefficients would be.
    remedy : str
        How it is found with everything else.
    """

    columns: tuple[Column, ...]
    largest: float
    as_well: str
    words: Callable[[Sequence[float]], str]
    remedy: str


@dataclass(frozen=True, slots=True)
class Explained:
    """Coefficients of a fault beside a model, and the share of what remains that it would explain."""

    fault: SensorFault
    coefficients: tuple[float, ...]
    share: float

    @property
    def words(self) -> str:
        """What would explain how much."""
        return f"{self.fault.words(self.coefficients)} would explain {100.0 * self.share:.0f} %"


def sensor_faults(base: BaseModel, sample_s: float) -> tuple[SensorFault, ...]:
    """List the faults that a base model holds at none.

    Parameters
    ----------
    base : BaseModel
    sample_s : float
        Between two samples: a delay of less is nobody's to exclude [s].
    """
    faults: list[SensorFault] = []
    if base.delay_s.is_held:
        remedy = "delay_s among the nuisances of the base model finds the delay with everything else"
        faults.append(SensorFault((DELAY,), sample_s, AS_LATE, _late_or_early, remedy))
    if base.coordinate is Coordinate.ROTATION and base.position_eccentricity.is_held:
        remedy = "position_eccentricity among the nuisances of the base model finds it with everything else"
        faults.append(SensorFault(OFF_CENTRE, FARTHEST_OFF_RAD, AS_BENT, _off_its_centre, remedy))
    return tuple(faults)


def explained_by(search: TermSearch, columns: Sequence[Column], fault: SensorFault) -> Explained | None:
    """Say what a fault would explain of what a model leaves.

    None where it does not hold from block to block, or explains little.
    """
    before = search.losses(columns)
    gains = before - search.losses([*columns, *fault.columns])
    excess = float(before.sum() - search.blocks.noise.sum())
    if not (mean_over_error(gains) >= MIN_GAIN_Z and gains.sum() >= MIN_SHARE * excess > 0.0):
        return None
    return Explained(fault, _fitted(search, columns, fault), min(float(gains.sum()) / excess, 1.0))


def told_from_sensor(
    search: TermSearch, columns: Sequence[Column], steps: list[SelectionStep], fault: SensorFault
) -> list[SelectionStep]:
    """Refuse the first step of a selection where a fault that nobody excludes would explain about as much."""
    if not steps or (best := steps[0].accepted) is None:
        return steps
    gains = search.losses(columns) - search.losses([*columns, *fault.columns])
    as_well = float(gains.sum()) >= MIN_TIED_SHARE * best.gain and mean_over_error(best.gains - gains) < TIE_Z
    if not as_well or mean_over_error(gains) < MIN_GAIN_Z:
        return steps
    if math.hypot(*_fitted(search, columns, fault)) > fault.largest:
        return steps
    return [replace(steps[0], accepted=None, tied_with=(), reason=fault.as_well)]


def sensor_notes(explained: Iterable[Explained]) -> list[str]:
    """Say what faults that the base model does not have would explain."""
    return [f"A{one.words[1:]} of what remains: {one.fault.remedy}." for one in explained]


def blamed_on_sensor(steps: list[SelectionStep], explained: Sequence[Explained]) -> list[SelectionStep]:
    """Give as the reason why no term was taken the fault that would explain most of what remains."""
    most = max(explained, key=lambda one: one.share, default=None)
    if most is None or most.share < MOST or not steps or steps[0].accepted is not None:
        return steps
    return [replace(steps[0], reason=f"{most.words} of it"), *steps[1:]]


def _fitted(search: TermSearch, columns: Sequence[Column], fault: SensorFault) -> tuple[float, ...]:
    """Coefficients of least squares of a fault beside a model's columns."""
    fit = fit_blocks(search.blocks, [*columns, *fault.columns], search.priors, search.nonnegative)
    return tuple(float(value) for value in fit.coefficients[-len(fault.columns) :])


def _late_or_early(coefficients: Sequence[float]) -> str:
    (delay_s,) = coefficients
    return f"a force recorded {_two_digits(1e3 * abs(delay_s))} ms {'late' if delay_s > 0.0 else 'early'}"


def _off_its_centre(coefficients: Sequence[float]) -> str:
    off_mrad = 1e3 * math.hypot(*coefficients)
    return f"an encoder that turns {_two_digits(off_mrad)} mrad off its centre"


def _two_digits(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}"
