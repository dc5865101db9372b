"""What is known of a cell as far as plans hang on it, and when they are stale."""

from typing import NamedTuple

import numpy as np

from impactcell.positioning.displacement_discrepancy import FEATURES
from impactcell.positioning.model_hypotheses import swing_std
from impactcell.positioning.planner_posterior import PlannerPosterior
from impactcell.positioning.scatter_hypotheses import quantile_scales
from impactcell.records import Samples

STALE = np.concatenate([[0.02, 0.04, 0.08, 0.03, 2.0], np.full(FEATURES, 0.03)])
"""Change of the posterior's mean or standard deviation, in its units, after which a table is made anew."""
STALE_SWING = 0.15
"""Change of `swing_std` after which a table is made anew."""
SCATTER_Z = np.array([1.0, 3.0])
"""Nodes at which scatter is compared."""
STALE_SCATTER = np.array([[4e-3, 4e-3, 0.02], [6e-3, 6e-3, 0.04]])
"""Change of the scatter at these nodes after which a table is made anew."""


class Knowledge(NamedTuple):
    """What a table hangs on: mean and deviation of the posterior, scatter at `SCATTER_Z`, swing."""

    mean: Samples
    std: Samples
    scatter: Samples
    swing: float


def knowledge_of(posterior: PlannerPosterior) -> Knowledge:
    """Return what a table made now would hang on."""
    scatter = quantile_scales(posterior.scatter_scores, SCATTER_Z)
    return Knowledge(posterior.mean, np.sqrt(np.diag(posterior.cov)), scatter, swing_std(posterior))


def near(now: Knowledge, then: Knowledge, times: float) -> bool:
    """Whether what is known now differs by less than so many times what makes a table stale."""
    return bool(
        (np.abs(now.scatter - then.scatter) < times * (STALE_SCATTER + 0.1 * then.scatter)).all()
        and (np.abs(now.mean - then.mean) < times * STALE).all()
        and (np.abs(now.std - then.std) < times * STALE).all()
        and abs(now.swing - then.swing) < times * STALE_SWING
    )
