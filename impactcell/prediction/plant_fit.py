"""The plant that was fitted to taps, and what it says of the friction of each of them."""

from dataclasses import dataclass, replace

from impactcell.features import Features
from impactcell.prediction.estimate import estimate_from_features
from impactcell.prediction.model import Model
from impactcell.prediction.told_parameters import parameters_in_words
from impactcell.records import Estimator, FrictionEstimate


@dataclass(frozen=True, slots=True, eq=False)
class PlantFit:
    """Outcome of a joint fit.

    Attributes
    ----------
    model : Model
        Nominal plant and priors, without predictors.
    used : tuple of int
        Cycle numbers of the taps that the fit could use.
    gap : float
        RMS of all residuals in blocks, 1 = noise.
    shared_error : float
        Relative standard deviation of mu_k/mu_s that all taps share; 0 takes each tap's own for all of it.
    onset_s : float
        Mean moment of first contact of the taps whose recorder does not tell it, by their own times; else 0.
    """

    model: Model
    used: tuple[int, ...]
    gap: float
    shared_error: float = 0.0
    onset_s: float = 0.0

    def estimate(self, tap: Features, model: Model) -> FrictionEstimate:
        """Estimate the friction of one of the taps that were fitted, by their model, calibrated or not.

        What this tap says of mu_k/mu_s is in the model: said twice, it would be believed too much.
        """
        friction = estimate_from_features(tap, model, self.gap)
        mu_s = friction.mu_s
        if friction.estimator is Estimator.WAVEFORM:
            shared = self.shared_error * mu_s.value
            mu_s = replace(mu_s, std=max(mu_s.std, shared), common_std=max(mu_s.common_std, shared))
        return replace(friction, mu_s=mu_s)

    @property
    def sentence(self) -> str:
        """The parameters with what is told of their standard deviations."""
        return parameters_in_words(self.model)
