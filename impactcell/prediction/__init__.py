"""mu_s and mu_k of a tap: by peak force (4), sliding distance (5), both (6), and from the whole waveform."""

from impactcell.prediction.calibration import calibrate
from impactcell.prediction.estimate import estimate, estimate_from_features
from impactcell.prediction.model import (
    PROVISIONAL,
    REMAINS,
    DistanceForm,
    ForceForm,
    Model,
    Predictor,
    Prior,
    Sensitivity,
    printed_predictor,
)

__all__ = [
    "PROVISIONAL",
    "REMAINS",
    "DistanceForm",
    "ForceForm",
    "Model",
    "Predictor",
    "Prior",
    "Sensitivity",
    "calibrate",
    "estimate",
    "estimate_from_features",
    "printed_predictor",
]
