"""Campaigns whose hidden effect is a law of two covariates: of the motion, or of a shot's column as well."""

import math

from impactcell.campaign import Campaign
from simulator.campaign import make
from simulator.campaign_scenario import CampaignScenario
from tests.discrepancy.study import Job, recorded, scenario

COLUMN = "oil temperature (°C)"
LOWEST, HIGHEST = 15.0, 40.0
"""Ends of the column [°C]."""
STARTS = (-0.006, 0.0, 0.006)
"""Places at which parts lie where the place counts [m]."""
WEDGE = {"coefficient_n_s_per_m": 60.0, "length_m": 0.025}
"""Film of oil in a wedge: its drag at x = 0, and where it would be infinite."""
DRAG = {"viscous_coefficient_n_s_per_m": 90.0}
"""Viscous friction at the lowest temperature."""


def thinning(temperature: float) -> float:
    """Viscosity of an oil over that at the lowest temperature: it halves every 9 °C."""
    return math.exp(-(temperature - LOWEST) * math.log(2.0) / 9.0)


def job(seed: int, shots: int = 48) -> Job:
    """Give a campaign in which nothing else is hidden."""
    return Job("removed", (), seed, shots=shots)


def oil_campaign(seed: int, *, shots: int = 48, column: tuple[float, float] = (LOWEST, HIGHEST)) -> Campaign:
    """Make a campaign whose viscous friction goes with the oil's temperature."""
    values = [LOWEST + 0.125 * i for i in range(201)]
    strength = [[value, thinning(value)] for value in values]
    return _made(
        job(seed, shots),
        columns={COLUMN: {"low": column[0], "high": column[1], "strength": strength}},
        hide=["viscous_friction"],
        strengths={"viscous_friction": DRAG},
    )


def wedge_campaign(seed: int, *, shots: int = 48) -> Campaign:
    """Make a campaign whose drag goes with speed and place."""
    return _made(
        job(seed, shots), starts_m=list(STARTS), hide=["wedge_drag"], strengths={"wedge_drag": WEDGE}
    )


def column_campaign(seed: int, effect: str = "", *, shots: int = 48) -> Campaign:
    """Make a campaign with a column that does nothing, whatever else is hidden."""
    hide = [] if effect in {"", "none"} else [effect]
    columns = {COLUMN: {"low": LOWEST, "high": HIGHEST}}
    return _made(job(seed, shots), columns=columns, hide=hide)


def _made(given: Job, **changes: object) -> Campaign:
    plan = CampaignScenario.model_validate(scenario(given).model_dump() | changes)
    return recorded(plan, make(plan)[1])
