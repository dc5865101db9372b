"""How much records need a term, or a function in one place, beside a smooth force."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from impactcell.discrepancy.machine.regression.smooth_force import Need
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.terms.base_model import TermChoice
from impactcell.discrepancy.machine.terms.rival_forms import FREE_FORMS, KNOTS

MIN_NEED = 3.0
"""Logarithm of how much likelier records have to be with a term than with a smooth force alone [1]."""
TIED_NEED = 3.0
"""Logarithm of how much likelier they are with the best term, up to which another one is tied with it [1]."""
FREE_SIZES = (1.0, 0.3, 0.1)
"""Sizes of the corners of a free form, over that at which one would explain all there is [1]."""


def needs_of_terms(
    need: Need,
    choices: Sequence[TermChoice],
    shapes: Mapping[str, Sequence[float]],
) -> dict[str, tuple[float, float]]:
    """By name of a term, how much likelier records are with it (logarithm), and the shape that they want.

    Every value of its shape is as likely beforehand as the others.
    """
    needs = {}
    for choice in choices:
        grid = shapes[choice.name]
        values = [need(ChosenTerm(choice, shape).columns, 1.0) for shape in grid]
        needs[choice.name] = _mean(values), grid[int(np.argmax(values))]
    return needs


def needs_of_free_forms(need: Need) -> dict[str, float]:
    """By free form, how much likelier records are with it, at corners of some size (logarithm)."""
    needs = {}
    for form in FREE_FORMS:
        corners = [(form, 0.0, number) for number in range(KNOTS)]
        needs[form] = _mean([need(corners, size) for size in FREE_SIZES])
    return needs


def _mean(logarithms: Sequence[float]) -> float:
    """Logarithm of the mean of what logarithms are given of."""
    return float(np.logaddexp.reduce(logarithms)) - math.log(len(logarithms))
