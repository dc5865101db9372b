"""What the cycles say of friction: estimates, wear, batch and signature, each with its quality."""

import enum
from dataclasses import dataclass

from impactcell.records.capture import Samples


class Quality(enum.IntEnum):
    """How far a value may be believed; ordered, so that the worst of several is their maximum.

    Maps onto the OPC UA status codes Good, Uncertain and Bad.
    """

    GOOD = 0
    UNCERTAIN = 1
    BAD = 2


class Estimator(enum.Enum):
    """Where a published friction coefficient came from."""

    WAVEFORM = "waveform"
    COMBINED = "combined"
    FORCE = "force"
    DISTANCE = "distance"
    NONE = "none"


@dataclass(frozen=True, slots=True)
class Coefficient:
    """A friction coefficient with one standard deviation; nan in both where there is none.

    Attributes
    ----------
    common_std : float
        Part of `std` that taps like this one share, as an error of the model's mu_k/mu_s or of the force's
        scale: the mean of many taps is no better than that. nan where it is not known.
    """

    value: float = float("nan")
    std: float = float("nan")
    quality: Quality = Quality.BAD
    reason: str = ""
    common_std: float = float("nan")


@dataclass(frozen=True, slots=True)
class FrictionEstimate:
    """Friction of one cycle, by every predictor, and the one that is published.

    Attributes
    ----------
    mu_s, mu_k : Coefficient
        Static and kinetic coefficient as published.
    by_force, by_distance, combined : Coefficient
        mu_s from equations (4), (5) and (6).
    estimator : Estimator
        Which predictor `mu_s` came from.
    peak_force_n, sliding_distance_m : float
        As read off the capture by a local fit.
    gap : float
        RMS of the normalised waveform residuals, 1 = the sensors' noise; nan without a waveform fit.
    """

    mu_s: Coefficient
    mu_k: Coefficient
    by_force: Coefficient
    by_distance: Coefficient
    combined: Coefficient
    estimator: Estimator
    peak_force_n: float
    sliding_distance_m: float
    gap: float = float("nan")


@dataclass(frozen=True, slots=True)
class WearState:
    """Friction followed over time: `level` is mu_s at the reference batch, `rate` its change per cycle.

    Standard deviations here come from how the estimates scatter. What all estimates of a cell share, such as
    an error of mass, of a sensor's scale or of the prior on mu_k/mu_s, moves the level as a whole: changes
    are known better than the level itself. Probability and cycles to the limit are those of the level as the
    cell measures it, for a limit that was set by what the cell shows. Cycles to the limit take wear to go on
    as it has; its rate may change by half of itself (95 %) over as many cycles as it was
    followed. Their interval is one of 95 % for wear that keeps its rate or changes it by no more. Where the
    rate doubles meanwhile, as that of wear that grows with the square of the cycles, the limit is passed
    sooner than told, and where wear comes to an end later or never.

    Attributes
    ----------
    level_common_std : float
        Standard deviation of what all estimates share, beside `level_std`; nan where it is not known.
    """

    level: float
    level_std: float
    rate_per_cycle: float
    rate_std: float
    limit: float
    probability_above_limit: float
    cycles_to_limit: float
    cycles_to_limit_low: float
    cycles_to_limit_high: float
    quality: Quality
    reason: str = ""
    level_common_std: float = float("nan")


@dataclass(frozen=True, slots=True)
class BatchState:
    """Offset of the present batch from the reference batch, and the last shift found.

    Attributes
    ----------
    last_shift_cycle : int
        Its first cycle as the module counted then, whether or not it has counted anew since; 0 before the
        first shift.
    """

    batch_id: str
    offset: float
    offset_std: float
    last_shift: float
    last_shift_std: float
    last_shift_cycle: int
    quality: Quality
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Signature:
    """Kinetic friction along one stroke, on the cell's fixed grid.

    Attributes
    ----------
    position_m : ndarray, shape (g,)
        Distance slid since loss of contact.
    friction, friction_std : ndarray, shape (g,)
        Coefficient at each grid point; nan where the part did not get that far.
    t_squared, spe : float
        Hotelling's T² on the leading components, and the noise-whitened squared prediction error;
        nan while the reference is being learned.
    deviates_at_m : float
        Distance slid where the deviation is largest; nan without a deviation.
    t_squared_limit, spe_limit : float
        From where on each of them makes a cycle deviant whatever the others say; a shape that is looked for
        can do so below both.
    """

    position_m: Samples
    friction: Samples
    friction_std: Samples
    t_squared: float
    spe: float
    deviates_at_m: float
    quality: Quality
    reason: str = ""
    t_squared_limit: float = float("nan")
    spe_limit: float = float("nan")
