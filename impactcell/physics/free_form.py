"""A place in the equations of motion at which a smooth function may act, and how it enters there."""

import re
from dataclasses import dataclass

from impactcell.physics.effect import Effect, LawKind

ACROSS = 4
"""B-splines along a second covariate: one cubic piece."""
FINE = "_fine"
"""End of the identifier of a finer term."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeForm:
    """A place in the equations of motion at which a free-form term may act.

    Attributes
    ----------
    effect : Effect
        What enters the plant.
    covariate : str
        `speed`, `position`, `indentation`, `indentation_rate`, `gap`, `time` or `force`.
    covariate_unit : str
    law_kind : LawKind or None
        None where the term acts between shots.
    around : str
        How the function s of the covariate u enters, as Python of the law's own four numbers a, b, c and d,
        e.g. `-b * s`.
    argument : str
        Python of the covariate in the same four numbers.
    constant_is : str
        Parameter of the nominal plant that does what a constant function would; empty where none does.
    dissipates : str
        Parameter of the plant to which the function is added where the sum must not be negative, lest it give
        energy; `0` where it is the function alone, empty where either sign is possible.
    second, second_unit, second_argument : str
        The same of the second covariate w, another number of the motion or a column of `shots.csv`; empty
        where the function has one alone.
    """

    effect: Effect
    covariate: str
    covariate_unit: str
    law_kind: LawKind | None
    around: str
    argument: str
    constant_is: str = ""
    dissipates: str = ""
    second: str = ""
    second_unit: str = ""
    second_argument: str = ""

    @property
    def place(self) -> str:
        """Identifier of the place, whatever the number of pieces."""
        return self.effect.identifier.removesuffix(FINE)

    @property
    def state(self) -> frozenset[str]:
        """Which of the first two numbers of its law it reads: `a`, `b` or both."""
        return frozenset(re.findall(r"\b[ab]\b", f"{self.argument} {self.around}"))

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Names of the parameters that a fit moves."""
        return tuple(parameter.name for parameter in self.effect.parameters[2 * len(self.covariates) :])

    @property
    def spans(self) -> int:
        """Polynomial pieces of its spline along its first covariate."""
        return len(self.coefficients) // (ACROSS if self.second else 1) - 3

    @property
    def covariates(self) -> tuple[str, ...]:
        """What the function is of."""
        return (self.covariate, self.second) if self.second else (self.covariate,)

    @property
    def has_constant(self) -> bool:
        """Whether a constant is a law of its own: the plant's damper only pushes, one of a law pulls."""
        return self.constant_is in {"", "damping_n_s_per_m"}

    @property
    def is_factor(self) -> bool:
        """Whether 1 + s multiplies the friction, so that s has no unit."""
        return self.law_kind is LawKind.SCALE or self.is_between_shots

    @property
    def is_between_shots(self) -> bool:
        """Whether it acts between shots, so that it shows in their friction factors only."""
        return self.law_kind is None

    @property
    def unit(self) -> str:
        """Unit of the function."""
        return self.effect.parameters[-1].unit
