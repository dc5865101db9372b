"""What is known of friction when taps are planned. Pure."""

import math

from impactcell.cell import CellDesign
from impactcell.records import Quality, Snapshot


def is_friction_known(snapshot: Snapshot | None, design: CellDesign) -> bool:
    """Whether it is: from cycles, or from the commissioning that calibrated the model."""
    seen = snapshot is not None and snapshot.wear.quality is not Quality.BAD
    return seen or bool(design.model.predictors)


def kinetic_friction(snapshot: Snapshot, design: CellDesign) -> tuple[float, float] | None:
    """Return mu_k of the present batch and its standard deviation; None while the tracker knows none."""
    wear, batch, model = snapshot.wear, snapshot.batch, design.model
    if wear.quality is Quality.BAD or not math.isfinite(wear.level + wear.level_std):
        return None
    offset = batch.offset if math.isfinite(batch.offset) else 0.0
    offset_std = batch.offset_std if math.isfinite(batch.offset_std) else 0.0
    mu_s = wear.level + offset
    std = math.hypot(math.hypot(wear.level_std, offset_std) * model.ratio, mu_s * model.prior.ratio_std)
    return (mu_s * model.ratio, std) if mu_s > 0.0 else None
