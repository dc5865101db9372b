"""Free-form terms over a further column of `shots.csv`: friction that goes with a temperature or a load.

The friction of a shot is mu (1 + s(u)) with the column's value u, wherever the column is known.
"""

import hashlib
import math
import re
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from impactcell.physics.bspline import spline_basis
from impactcell.physics.effect import Covariates, Effect, Factors, Kind, Parameter, Phase
from impactcell.physics.effect_names import COLUMN_PREFIX
from impactcell.physics.effects import add_effect
from impactcell.physics.free_form import FreeForm
from impactcell.physics.free_forms import LOWER, SPANS, UPPER
from impactcell.records import Samples

MOST_LETTERS = 40
"""Letters of a column's name that are told."""
TYPICAL = 0.1
"""Change of friction that shows clearly."""
Between = Callable[[Sequence[Samples], Covariates], Factors]


@cache
def column_form(column: str) -> FreeForm:
    """Free-form factor of the friction over a column; the same one whenever it is asked for."""
    letters = column_letters(column)
    check = hashlib.sha256(column.encode()).hexdigest()[:6]
    knots = tuple(
        Parameter(end, "1", null=math.nan, lower=-math.inf, upper=math.inf, typical=1.0)
        for end in (LOWER, UPPER)
    )
    coefficients = tuple(
        Parameter(f"c{i}", "1", null=0.0, lower=-1e3 * TYPICAL, upper=1e3 * TYPICAL, typical=TYPICAL)
        for i in range(SPANS + 3)
    )
    effect = Effect(
        identifier=f"{COLUMN_PREFIX}{letters}_{check}",
        kind=Kind.BETWEEN_SHOTS,
        equation=f"mu (1 + s({printed(column)}))",
        reference="Free-form term: cubic B-spline, de Boor (1978)",
        phases=(Phase.BETWEEN_SHOTS,),
        parameters=(*knots, *coefficients),
        between=_factors(column),
        columns={column: (-math.inf, math.inf)},
    )
    add_effect(effect)
    return FreeForm(effect, column, "1", None, "1.0 + s", "", constant_is="mu_k")


def column_letters(column: str) -> str:
    """Letters and digits of a column's name, as an identifier may have them."""
    return re.sub(r"[^a-z0-9]+", "_", column.lower()).strip("_")[:MOST_LETTERS]


def printed(column: str) -> str:
    """Name of a column as it may stand in a sentence or in the text of an effect file."""
    return re.sub(r"[^\w .,()/%°-]", "_", column)[:MOST_LETTERS]


def _factors(column: str) -> Between:
    def factors(parameters: Sequence[Samples], shots: Covariates) -> Factors:
        """1 + s(u) on both coefficients; 1 where the column is not known."""
        lower, upper, *coefficients = parameters
        u = shots.columns[column]
        known = np.isfinite(u)
        basis = spline_basis(np.where(known, u, lower), float(lower[0]), float(upper[0]), SPANS)
        factor = np.where(known, 1.0 + np.einsum("nk,nk->n", basis, np.column_stack(coefficients)), 1.0)
        return Factors(factor, factor, np.ones(()))

    return factors
