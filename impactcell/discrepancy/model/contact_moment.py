"""When first contact was: at t = 0 as a record says, or anywhere within a sampling step of it."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.model.shot_fits import shot_equations

MIN_STEP_SHARE = 0.1
"""Scatter of contact among like shots, in sampling steps, from which on it lies where the samples happen to
fall: a recorder that shows it by its samples alone makes 0.29, one that tells it exactly made 0.06 at most,
whatever was hidden and however strong."""
FEWEST_TO_SEE, FEWEST_TO_TELL = 2, 6
"""Degrees of freedom of this scatter from which on it is looked at, and from which on its absence is
believed: of 6 a recorder's would be missed in 0.6 % of the campaigns, of 2 in 11 %."""


@dataclass(frozen=True, slots=True)
class ContactScatter:
    """How first contact differs among shots of the same settings.

    What a model lacks moves contact as well, but alike in like shots.

    Attributes
    ----------
    std_s, error_s : float
        Standard deviation, nan without replicates, and what noise makes of it by the gap that there is.
    step_s : float
        Sampling step.
    degrees_of_freedom : int
    """

    std_s: float
    error_s: float
    step_s: float
    degrees_of_freedom: int

    @property
    def is_seen(self) -> bool:
        """Whether contact lies where the samples happen to fall."""
        enough = self.degrees_of_freedom >= FEWEST_TO_SEE
        return enough and self.std_s > max(MIN_STEP_SHARE * self.step_s, self.error_s)

    @property
    def is_open(self) -> bool:
        """Whether it may lie there, for too few replicates say that it does not."""
        return self.is_seen or self.degrees_of_freedom < FEWEST_TO_TELL


def contact_scatter(problem: Problem, fitted: Fit) -> ContactScatter:
    """Scatter of the moments of first contact about those of like shots, as they were fitted."""
    model = problem.with_effects(fitted.effects)
    column = model.shot_parameter_names.index("onset_s")
    _, member = np.unique([shot.group for shot in problem.shots.items], return_inverse=True)
    own_s = fitted.shot_parameters.onset_s
    of_group_s = np.bincount(member, own_s) / np.bincount(member)
    degrees_of_freedom = len(own_s) - len(of_group_s)
    square = float(np.sum((own_s - of_group_s[member]) ** 2))
    variances = shot_equations(model, fitted.state).inverse[:, column, column]
    gap = math.sqrt(float(fitted.residual @ fitted.residual) / fitted.residual.size)
    return ContactScatter(
        math.sqrt(square / degrees_of_freedom) if degrees_of_freedom else math.nan,
        math.sqrt(float(np.median(variances))) * max(gap, 1.0),
        float(np.median(model.onset_step_s)),
        degrees_of_freedom,
    )


def contact_note(fitted: Fit, *, remains: bool = False) -> str:
    """Say over what time first contact lies; where something remains, over what time it seems to."""
    first, last = (1e6 * float(of(fitted.shot_parameters.onset_s)) for of in (np.min, np.max))
    if remains:
        return (
            f"First contact is fitted shot by shot and comes out {first:.0f} to {last:.0f} µs from t = 0; "
            "that may be what the model lacks."
        )
    return (
        f"First contact lies {first:.0f} to {last:.0f} µs from t = 0, within a sampling step: "
        "it is fitted shot by shot."
    )
