"""Whether t = 0 is first contact, as recorders say: a trigger that is late makes mu_s wrong.

A contact of k = 6.5e5 N/m at 0.05 m/s rises by 0.6 N in 20 µs. Taken as the force of t = 0 it is that of a
part which sticks for longer, and of a light part mu_s comes out twice as large, sure of itself.
"""

from collections.abc import Sequence
from dataclasses import replace

from impactcell.errors import NotConvergedError, PredictionError
from impactcell.features import Features
from impactcell.prediction.joint_plant_fit import fit_plant
from impactcell.prediction.plant_fit import PlantFit

ONSET_STD_S = 5e-5
"""Standard deviation of first contact about t = 0 that is tried [s]: triggers are late by tens of µs."""
MIN_FALL = 0.03
"""Fall of the squared gap from which on taps say that contact was elsewhere: three times what noise makes."""
GAP_ENOUGH = 1.05
"""Gap that has to be reached: what is missing elsewhere in the model is no matter of first contact."""


def fit_plant_and_onset(
    taps: Sequence[Features], gravity_m_s2: float, name: str = "fitted"
) -> tuple[PlantFit, Sequence[Features]]:
    """Fit the plant, with the moment of contact of each tap where they do not agree with contact at t = 0.

    Returns
    -------
    fit : PlantFit
    taps : sequence of Features
        As they were fitted.

    Raises
    ------
    PredictionError
        As `fit_plant`.
    """
    fit: PlantFit | None = None
    fault: NotConvergedError | None = None
    try:
        fit = fit_plant(taps, gravity_m_s2, name)
    except NotConvergedError as found:
        fault = found
    told = [not tap.capture.onset_std_s for tap in taps]
    if any(told) and (fit is None or fit.gap**2 > 1.0 + MIN_FALL):
        freed = [_with_open_onset(tap) if closed else tap for tap, closed in zip(taps, told, strict=True)]
        try:
            other = fit_plant(freed, gravity_m_s2, name)
        except PredictionError:
            other = None
        falls = other is not None and (fit is None or fit.gap**2 - other.gap**2 > MIN_FALL)
        if other is not None and falls and other.gap < GAP_ENOUGH:
            return other, freed
    if fit is None:
        raise fault or NotConvergedError("the plant could not be fitted to the campaign")
    return fit, taps


def onset_sentence(onset_s: float) -> str:
    """Say where first contact lies, by the times of a recorder that is taken to begin there."""
    side = "before" if onset_s < 0.0 else "after"
    return f"first contact lies {1e6 * abs(onset_s):.2g} µs {side} t = 0 in these taps"


def _with_open_onset(tap: Features) -> Features:
    return replace(tap, capture=replace(tap.capture, onset_std_s=ONSET_STD_S))
