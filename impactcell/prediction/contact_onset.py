"""Where first contact lies: within a sampling step of t = 0, or where a late trigger puts it.

A contact of k = 6.5e5 N/m at 0.05 m/s rises by 0.6 N in 20 µs. Taken as the force of t = 0 it is that of a
part which sticks for longer, and of a light part mu_s comes out twice as large, sure of itself.
"""

from collections.abc import Sequence
from dataclasses import replace

from impactcell.errors import NotConvergedError, PredictionError
from impactcell.features import Features
from impactcell.prediction.joint_plant_fit import fit_plant
from impactcell.prediction.phase_reweighting import MISFIT_THRESHOLD
from impactcell.prediction.plant_fit import PlantFit
from impactcell.records import Capture, as_recorded, sampling_step_s, with_open_onset

ONSET_STD_S = 5e-5
"""Standard deviation of first contact about t = 0 that is tried [s]: triggers are late by tens of µs."""
MIN_FALL = 0.03
"""Fall of the squared gap from which on taps say that contact was elsewhere: three times what noise makes."""
GAP_ENOUGH = 1.05
"""Gap that a later contact has to reach: what is missing elsewhere in the model is no matter of it."""


def fit_plant_and_onset(
    taps: Sequence[Features], gravity_m_s2: float, name: str = "fitted"
) -> tuple[PlantFit, Sequence[Features]]:
    """Fit the plant with each tap's moment of contact: within a step, or farther if that explains the taps.

    Mass, velocity and the sensors' scales are each tap's own as well, as far as that explains the taps.

    Returns
    -------
    fit : PlantFit
    taps : sequence of Features
        Their captures say what is known of contact, mass, velocity and scales.

    Raises
    ------
    PredictionError
        As `fit_plant`.
    """
    measured = [_told(tap, as_recorded(tap.capture)) for tap in taps]
    open_fit, fault = _fitted(measured, gravity_m_s2, name)
    if open_fit is not None and open_fit.gap**2 <= 1.0 + MIN_FALL:
        return open_fit, measured
    # What no mass, velocity or scale explains is the model's fault, and they would follow it.
    exact = [_told(tap, with_open_onset(tap.capture)) for tap in taps]
    fit, fault = _fitted(exact, gravity_m_s2, name)
    later = [
        _told(tap, replace(tap.capture, onset_std_s=max(tap.capture.onset_std_s, ONSET_STD_S)))
        for tap in measured
    ]
    other, _ = _fitted(later, gravity_m_s2, name)
    falls = other is not None and (fit is None or fit.gap**2 - other.gap**2 > MIN_FALL)
    if other is not None and falls and other.gap < GAP_ENOUGH:
        return other, later
    # A gap of some per cent, as of noise that is stated a little low, makes nothing exact that was told.
    if open_fit is not None and open_fit.gap <= MISFIT_THRESHOLD:
        return open_fit, measured
    if fit is None:
        raise fault or NotConvergedError("the plant could not be fitted to the campaign")
    return fit, measured


def _fitted(
    taps: Sequence[Features], gravity_m_s2: float, name: str
) -> tuple[PlantFit | None, PredictionError | None]:
    """Fit the plant, or give the fault for which it cannot be."""
    try:
        return fit_plant(taps, gravity_m_s2, name), None
    except PredictionError as fault:
        return None, fault


def _told(tap: Features, capture: Capture) -> Features:
    return replace(tap, capture=capture)


def is_late(fit: PlantFit, taps: Sequence[Features]) -> bool:
    """Whether first contact lies farther from t = 0 than a sampling step, by a fit that explains its taps."""
    return fit.gap < GAP_ENOUGH and abs(fit.onset_s) > max(sampling_step_s(tap.capture) for tap in taps)


def onset_sentence(onset_s: float) -> str:
    """Say where first contact lies, by the times of a recorder that is taken to begin there."""
    side = "before" if onset_s < 0.0 else "after"
    rounded_us = float(f"{1e6 * abs(onset_s):.2g}")
    return f"first contact lies {rounded_us:g} µs {side} t = 0 in these taps"
