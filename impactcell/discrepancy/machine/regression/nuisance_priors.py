"""Numbers of a base model that are columns of the regression, as deviations from what is stated."""

import math

from impactcell.discrepancy.machine.regression.weak_form import ECCENTRICITY, INERTIA_BESIDE, Column
from impactcell.discrepancy.machine.terms.base_model import BaseModel, NumberPrior

NUISANCES = ("force_gain", "force_offset", "gravity_torque", "position_offset", "inertia", "delay_s")
"""Their names."""
OFFSET: Column = ("force_offset", 0.0, 0)
"""Column of a constant force."""


def nuisance_priors(base: BaseModel, gravity_torque: float) -> dict[Column, NumberPrior]:
    """Give the columns that data may move, and what is known of their coefficients.

    Parameters
    ----------
    base : BaseModel
    gravity_torque : float
        G as it is known so far [N m]: without it the zero of the position makes no force.
    """
    priors: dict[Column, NumberPrior] = {}
    for name in NUISANCES:
        prior: NumberPrior = getattr(base, name)
        if prior.is_held or (name == "position_offset" and gravity_torque == 0.0):
            continue
        if name == "force_offset" and base.force_offset_by_record:
            continue
        if name == "inertia" and prior.value == 0.0:
            priors[INERTIA_BESIDE] = NumberPrior(0.0, prior.std)
            continue
        # The column of the inertia is relative to its stated value.
        std = prior.std / prior.value if name == "inertia" and math.isfinite(prior.value) else prior.std
        priors[name, 0.0, 0] = NumberPrior(0.0, std)
    if not base.position_eccentricity.is_held:
        for number in range(2):
            priors[ECCENTRICITY, 0.0, number] = base.position_eccentricity
    return priors
