"""What goes into one cycle of tracking, what is kept between cycles, and what comes out."""

import math
from dataclasses import dataclass, field

from impactcell.records import (
    BatchState,
    Capture,
    Evidence,
    FrictionEstimate,
    Quality,
    Samples,
    WearState,
)
from impactcell.tracking.wear_batch.input_validation import CycleClock, CycleTiming
from impactcell.tracking.wear_batch.noise_identification import CommissioningRecord
from impactcell.tracking.wear_batch.noise_scale import NoiseScale
from impactcell.tracking.wear_batch.run_length_bank import EMPTY
from impactcell.tracking.wear_batch.walk_models import WalkModels
from impactcell.tracking.wear_batch.wear_blocks import WearBlocks
from impactcell.tracking.wear_batch.wear_filter import WearFilter


@dataclass(frozen=True, slots=True)
class FrictionObservation:
    """What one cycle brings: mu_s, its standard deviation (nan where there is none), what the PLC says.

    Attributes
    ----------
    expected_change : bool
        What the estimate is of changes with this cycle, and somebody said so: another batch, another model.
    session : int
        The module's; another one than before counts its cycles anew. 0 where it is not known.
    doubt : str
        Why mu_s is uncertain; empty where it is not.
    common_std : float
        Part of mu_s_std that other cycles share; nan where it is not known.
    number_is_sure : bool
        The cycle's number is not to be doubted however far ahead it is: those after it are known.
    restarted : bool
        The module is known to count its cycles anew from this one on, also where it has no session.
    """

    cycle: int
    mu_s: float
    mu_s_std: float
    time_ns: int = 0
    batch_id: str | None = None
    expected_change: bool = False
    session: int = 0
    doubt: str = ""
    common_std: float = math.nan
    number_is_sure: bool = False
    restarted: bool = False

    @classmethod
    def of(
        cls,
        capture: Capture,
        estimate: FrictionEstimate,
        batch_id: str | None,
        *,
        expected: bool = False,
        restarted: bool = False,
    ) -> "FrictionObservation":
        """Take the published mu_s of the estimate from a capture."""
        mu_s = estimate.mu_s
        doubt = mu_s.reason if mu_s.quality is Quality.UNCERTAIN else ""
        return cls(
            capture.cycle,
            mu_s.value,
            mu_s.std,
            capture.time_ns,
            batch_id,
            expected,
            capture.session,
            doubt,
            mu_s.common_std,
            restarted=restarted,
        )


ANNOUNCED, UNSAID, RULED_OUT = 1.0, 0.0, -1.0
"""What is known of a batch change with a cycle: one came, nobody says, surely none."""


@dataclass(frozen=True, slots=True)
class UsableCycle:
    """One cycle that can be used, with what was settled about it before anything is estimated.

    Attributes
    ----------
    timing : CycleTiming
        Where it belongs in the order of cycles.
    noise : NoiseScale
        With this cycle in it.
    std, variance : float
        Standard deviation that it declares (or the usual one), and its variance as the noise makes it.
    announced : float
        `ANNOUNCED`, `UNSAID` or `RULED_OUT`.
    """

    observation: FrictionObservation
    timing: CycleTiming
    noise: NoiseScale
    std: float
    variance: float
    announced: float = UNSAID


@dataclass(frozen=True, slots=True)
class ChangePoint:
    """The last batch shift: index of its first cycle, size in mu_s, and how it was found.

    Attributes
    ----------
    cycle, detected_at : int
        Indices of the first cycle after it, and of the one at which it was certain enough.
    size, size_std : float
        mu_s after it minus mu_s before, and its standard deviation.
    statistic, threshold : float
        Detection statistic and what it had to pass; nats.
    """

    cycle: int
    size: float
    size_std: float
    detected_at: int = 0
    statistic: float = math.nan
    threshold: float = math.nan


@dataclass(frozen=True, slots=True)
class RateChange:
    """The last change of the wear rate: index of its first cycle, mu_s a cycle before and after it.

    Attributes
    ----------
    after_std : float
        Standard deviation of the rate after it, when it was detected.
    detected_at : int
        Index of the cycle at which it was certain enough.
    """

    cycle: int
    before: float
    after: float
    after_std: float
    detected_at: int


@dataclass(frozen=True, slots=True, eq=False)
class TrackerState:
    """All that is kept between cycles; `impactcell.serialization` writes it bit for bit.

    Attributes
    ----------
    clock : CycleClock
        Which cycles have been seen, and when.
    filter : WearFilter or None
        The filter that believes the PLC's batch ids.
    bank : ndarray, shape (k, 22)
        Run-length hypotheses, see `impactcell.tracking.wear_batch.run_length_bank`.
    rates : ndarray, shape (m, 22)
        Hypotheses of another wear rate, see `impactcell.tracking.wear_batch.rate_changes`.
    outliers : tuple of float
        Outliers among the bank's estimates, and how many estimates, both fading.
    accepted, accepted_before : int
        Indices of the last two cycles at which the bank's shift was reported.
    batch_start, batch_count : int
        Index at which the PLC's present batch began, and how many there have been.
    tested : bool
        The present known batch has been reported as shifted, or was expected to be.
    replayed_noise : NoiseScale
        As it was when the first cycles were last gone over with it.
    rate_change : RateChange or None
        The last that was found.
    walk_models : WalkModels or None
        How much more likely other random walks of level and slope have become; None while commissioning, and
        until the next cycle after a change of rate.
    wear_blocks : WearBlocks or None
        What all cycles say of wear where nobody says of which batch they are; None while the filter does.
    common_variance, common_cycles : float
        Of what the estimates of the reference batch share, the mean, and the cycles that it is of.
    expects_change : bool
        Somebody said that what estimates are of changes, and no cycle since could be used in its order.
    """

    clock: CycleClock = field(default_factory=CycleClock)
    noise: NoiseScale = field(default_factory=NoiseScale)
    filter: WearFilter | None = None
    bank: Samples = field(default_factory=lambda: EMPTY)
    rates: Samples = field(default_factory=lambda: EMPTY)
    outliers: tuple[float, float] = (0.0, 0.0)
    accepted: int = 0
    accepted_before: int = 0
    batch_id: str | None = None
    previous_batch: str | None = None
    batch_start: int = 0
    batch_count: int = 0
    tested: bool = True
    change_point: ChangePoint | None = None
    rate_change: RateChange | None = None
    first_index: int = 0
    replayed_noise: NoiseScale = field(default_factory=NoiseScale)
    commissioning: CommissioningRecord | None = None
    walk_models: WalkModels | None = None
    level_variance: float = 0.0
    slope_variance: float = 0.0
    wear_blocks: WearBlocks | None = None
    common_variance: float = math.nan
    common_cycles: float = 0.0
    expects_change: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class TrackingResult:
    """Outcome of one cycle.

    Attributes
    ----------
    shift : Evidence or None
        Set at the one cycle at which a batch shift is detected.
    expected : bool
        The PLC announced a batch change with this cycle: the alarm is to stay silent.
    horizon, probability_at_horizon : float
        Cycles that are looked ahead, and the probability that the level will be above the limit then; nan
        without a limit.
    innovation : float
        Measurement minus prediction in standard deviations; nan if not used.
    used : bool
        Whether the estimate went into the state.
    notes : tuple of str
        What was wrong with the estimate, and what was done about it.
    """

    state: TrackerState
    wear: WearState
    batch: BatchState
    shift: Evidence | None
    expected: bool
    horizon: float
    probability_at_horizon: float
    innovation: float
    used: bool
    notes: tuple[str, ...]


def initial_state() -> TrackerState:
    """State before the first cycle."""
    return TrackerState()


def reset_wear_level(state: TrackerState) -> TrackerState:
    """State after the surface was renewed: the next cycle is a new reference.

    The noise stays learned, and so do random walks of level and slope where there are any.
    """
    return TrackerState(
        clock=state.clock,
        noise=state.noise,
        level_variance=state.level_variance,
        slope_variance=state.slope_variance,
    )
