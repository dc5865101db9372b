"""Numbers by which the search decides; set on simulated campaigns, none of which the study counts."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SearchPolicy:
    """How far a search goes, and what it takes for a name.

    Attributes
    ----------
    max_screened : int
        Most promising candidates that are fitted at all.
    min_screened_gain : float
        First-order fall of the squared misfit below which a candidate that is not significant is not fitted.
    starts_per_effect, start_steps : int
        Best points of an effect's grid from which fits start, and the steps after which the best goes on.
    screen_steps, refine_steps, final_steps : int
        Gauss-Newton steps on few samples, of the likeliest on few samples, and of finalists on all.
    max_refined : int
        Screened models that are refined.
    min_finalists, max_finalists : int
        Refined models that are fitted to all samples: so many, and more where few samples do not tell.
    alike_share : float
        Share of its gain by which another effect's may differ from that of the likeliest for it to be fitted,
        whatever became of it on few samples.
    max_rms_at_floor : float
        RMS, in noise floors, up to which a model comes near the noise.
    min_gain : float
        Log-likelihood that a second effect has to add; one that is worth less has no visible gap.
    max_spread_ratio : float
        Or by which factor it has to lower the spread of the friction factors, if it acts between shots.
    bound_share : float
        Share of the (logarithmic) range of a shape that counts as its end.
    max_first_effects, max_second_effects : int
        Effects beside which a second one is looked for, and seconds beside each.
    max_promise : float
        Fall of the cost, over the mean squared residual, that a converged fit may still promise; good fits
        have been seen to rest at 5, as events make the cost uneven.
    max_promised_share : float
        Or this share of what is left above the noise: far from the floor a fit ends earlier.
    max_nesting_loss : float
        Log-likelihood by which a fit may be behind a model inside it.
    min_refit_gain : float
        Log-likelihood by which a single effect, fitted again from where a pair stands, must beat the best.
    min_share_explained : float
        Share of the gap that an effect must explain where the floor is only a lower bound.
    max_rival_share : float
        Share of what it leaves by which a rival may be behind it and still be tied.
    rival_probability : float
        Probability of the ratio of what two models leave, beyond which one is told from the other although
        neither reaches the floor.
    dominance_error : float
        Over the library, that an effect without part in a gap stands out; held-out shots are asked as well.
    between_shots_error : float
        Over the effects between shots, that one of them explains the friction factors by chance: small, since
        what is found there goes before all that stands out in the traces.
    max_bound_lead : float
        Share of the gap by which a shape at the end of its range may be ahead of the effect that stands out.
    """

    max_screened: int = 10
    min_screened_gain: float = 15.0
    starts_per_effect: int = 2
    start_steps: int = 2
    screen_steps: int = 5
    refine_steps: int = 25
    final_steps: int = 40
    max_refined: int = 5
    min_finalists: int = 2
    max_finalists: int = 6
    alike_share: float = 0.01
    max_rms_at_floor: float = 1.1
    min_gain: float = 30.0
    max_spread_ratio: float = 0.85
    bound_share: float = 0.01
    max_first_effects: int = 4
    max_second_effects: int = 5
    max_promise: float = 12.0
    max_promised_share: float = 1e-3
    max_nesting_loss: float = 1.0
    min_refit_gain: float = 2.0
    min_share_explained: float = 0.5
    max_rival_share: float = 0.5
    rival_probability: float = 0.9
    dominance_error: float = 0.05
    between_shots_error: float = 0.001
    max_bound_lead: float = 0.05


POLICY = SearchPolicy()
"""The policy in use."""
