"""What numbers that a base model holds would explain of what a model leaves, and how that is told."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from impactcell.discrepancy.machine.regression.held_number import HeldNumber
from impactcell.discrepancy.machine.regression.trials import TermSearch
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.search.held_numbers import fitted, hold
from impactcell.discrepancy.machine.search.selection import MIN_SHARE, SelectionStep
from impactcell.discrepancy.machine.search.ties import MIN_TIED_SHARE
from impactcell.physics.effect_names import in_words

MOST = 0.5
"""Share of what remains from which on a number that is off is what the headline tells [1]."""


@dataclass(frozen=True, slots=True)
class Explained:
    """Coefficients of a number that is off, beside a model, and the share of what remains it explains."""

    number: HeldNumber
    coefficients: tuple[float, ...]
    share: float

    @property
    def words(self) -> str:
        """What would explain how much."""
        return f"{self.number.sized(self.coefficients)} would explain {100.0 * self.share:.0f} %"


def explained_by(search: TermSearch, columns: Sequence[Column], number: HeldNumber) -> Explained | None:
    """Say what a number that is off would explain of what a model leaves.

    None where it does not hold from block to block, or explains little.
    """
    before = search.losses(columns)
    gains = before - search.losses([*columns, *number.columns])
    excess = float(before.sum() - search.blocks.noise.sum())
    if not (hold(search, gains, before) and gains.sum() >= MIN_SHARE * excess > 0.0):
        return None
    coefficients = fitted(search.blocks, columns, number, search.priors, search.nonnegative)
    if not number.is_possible(coefficients):
        return None
    return Explained(number, coefficients, min(float(gains.sum()) / excess, 1.0))


def held_number_notes(explained: Sequence[Explained]) -> list[str]:
    """Say what numbers that the base model holds would explain, each by itself: those that explain most."""
    most = max((one.share for one in explained), default=0.0)
    return [
        f"A{one.words[1:]} of what remains: {one.number.keys} finds it with everything else."
        for one in explained
        if one.share >= MIN_TIED_SHARE * most
    ]


def absent_gravity_notes(steps: Sequence[SelectionStep]) -> list[str]:
    """Say what would tell from a term a torque of gravity that the base model does not have."""
    return [
        "Where gravity acts, gravity_torque_n_m is free in the base model; wider angles tell it from "
        f"{in_words(step.accepted.term.choice.name)}."
        for step in steps
        if step.accepted is not None and "gravity_torque" in step.tied_with
    ]


def explains_most(explained: Sequence[Explained]) -> Explained | None:
    """Give the number that would explain most of what remains; None where none does."""
    most = max(explained, key=lambda one: one.share, default=None)
    return None if most is None or most.share < MOST else most


def blamed_on_number(steps: list[SelectionStep], explained: Sequence[Explained]) -> list[SelectionStep]:
    """Give as the reason why no term was taken the number that would explain most of what remains."""
    most = explains_most(explained)
    if most is None or not steps or steps[0].accepted is not None:
        return steps
    return [replace(steps[0], reason=f"{most.words} of it"), *steps[1:]]
