"""What a tap teaches: first how well it was foretold, then what that says of the cell."""

import numpy as np

from impactcell.positioning.displacement_band import BAND_Z, displacement_band
from impactcell.positioning.model_hypotheses import with_score
from impactcell.positioning.planner_posterior import PlannerPosterior
from impactcell.positioning.posterior_update import update_posterior
from impactcell.positioning.prediction_watch import as_measured, score_of
from impactcell.positioning.tap import Tap
from impactcell.positioning.tap_model import model_of_tap
from impactcell.records import Samples


def posterior_after(
    posterior: PlannerPosterior, tap: Tap, moved_m: float, part: Samples, noise_m: float
) -> PlannerPosterior:
    """Posterior after a tap that moved the part by `moved_m`, measured with a standard deviation `noise_m`.

    Parameters
    ----------
    moved_m, noise_m : float
        m; `moved_m` positive along the tap.
    part : ndarray
        As in `impactcell.positioning.displacement_quantiles.Scenarios`.
    """
    place = np.array([tap.position_m, float(tap.direction)])
    band = displacement_band(posterior, tap.velocity_m_s, np.array([tap.stroke_m]), part, place)[0]
    if np.isfinite(band).all() and band[BAND_Z.size // 2] > 0.0:
        score = score_of(moved_m, as_measured(band, BAND_Z, noise_m), BAND_Z)
        posterior = with_score(posterior, score)
    return update_posterior(posterior, model_of_tap(tap, posterior, part), moved_m, noise_m)
