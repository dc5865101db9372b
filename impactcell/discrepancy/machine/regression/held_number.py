"""A number that a base model holds, and how one would speak of it if it were off."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.terms.base_model import BaseModel, NumberPrior

DELAY: Column = ("delay_s", 0.0, 0)
"""Column of how late the force was recorded: the force's derivative."""


@dataclass(frozen=True, slots=True)
class HeldNumber:
    """A number that a base model holds, and how one would speak of it if it were off.

    Attributes
    ----------
    name : str
        Attribute of the base model.
    columns : tuple of Column
    phrase : str
        What would be off.
    sized : callable
        The same with its size, from its coefficients.
    key : str
        Where the base model would leave it free.
    largest : float
        Error of a sensor up to which nobody can exclude it who has not stated it [s or rad]: nothing is named
        that it explains as well. 0 of a number that is none of a sensor.
    farthest : float
        Error beyond which it explains nothing, in the unit of its coefficients: a gain of nought would take
        all force out of a model.
    is_positive : bool
        It is nothing below 0.
    is_absent : bool
        The base model has none of it: a term that it explains as well is tied with it.
    other_key : str
        Where the base model would leave free what records do not tell from it; empty where there is nothing.
    """

    name: str
    columns: tuple[Column, ...]
    phrase: str
    sized: Callable[[Sequence[float]], str]
    key: str
    largest: float = 0.0
    farthest: float = math.inf
    is_positive: bool = False
    is_absent: bool = False
    other_key: str = ""

    @property
    def keys(self) -> str:
        """Where the base model would leave it free, or what is not told from it."""
        return f"{self.key} or {self.other_key}" if self.other_key else self.key

    @property
    def is_delay(self) -> bool:
        """Whether it is how late the force was recorded, which is looked for within a prior only."""
        return self.columns == (DELAY,)

    def is_possible(self, coefficients: Sequence[float]) -> bool:
        """Whether a number may be so far off."""
        is_near = math.hypot(*coefficients) <= self.farthest
        return is_near and not (self.is_positive and coefficients[0] <= 0.0)

    @property
    def as_well(self) -> str:
        """Why a term is not taken that explains no more."""
        least = " by less than a sample" if self.is_delay else ""
        return f"{self.phrase}{least} would explain as much as the best term"

    @property
    def better(self) -> str:
        """Why a term is not taken that explains less."""
        return f"{self.phrase} would explain more than the best term"

    @property
    def as_a_law(self) -> str:
        """Why no law is proposed that explains no more."""
        return (
            f"{self.phrase} does as well as any function of speed, load or position; {self.keys} would tell"
        )

    @property
    def beside_a_law(self) -> str:
        """What is told of a law that was found with this number left free."""
        return (
            f"A{self.phrase[1:]} explains nearly all that any function of speed, load or position would; "
            f"the law is of what is left beside it, and has {self.key}."
        )

    def freed(self, base: BaseModel) -> BaseModel:
        """Leave the number free."""
        prior: NumberPrior = getattr(base, self.name)
        changed: BaseModel = replace(base, **{self.name: replace(prior, std=math.inf)})  # type: ignore[arg-type]
        return changed
