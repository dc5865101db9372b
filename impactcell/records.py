"""The nouns of impactcell: what flows from the module to SCADA, as frozen values in SI units.

A `Capture` comes in; `FrictionEstimate`, `WearState`, `BatchState`, `Signature` and `Alarm` are made
from it; a `Snapshot` holds them together for one cycle and is what is published and journalled.
"""

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.float64]


class Quality(enum.IntEnum):
    """How far a value may be believed; ordered, so that the worst of several is their maximum.

    Maps onto the OPC UA status codes Good, Uncertain and Bad.
    """

    GOOD = 0
    UNCERTAIN = 1
    BAD = 2


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """Samples of one sensor during one cycle.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        Strictly increasing, 0 at first contact (at the first sample where there is no contact).
        Sampling need not be uniform: a campaign may have gaps.
    values : ndarray, shape (n,)
        SI units of the quantity.
    noise_std : float or None
        Standard deviation of the sensor's white noise, None where it is not known.
    full_scale : tuple of float or None
        Smallest and largest value the channel can show; a sample at either end is saturated.
    resolution : float or None
        Value of one step of the sensor's integer code; None where values are not such multiples.
    """

    time_s: Samples
    values: Samples
    noise_std: float | None = None
    full_scale: tuple[float, float] | None = None
    resolution: float | None = None


def uniform_times(start_s: float, rate_hz: float, count: int) -> Samples:
    """Give sample times `start_s + i / rate_hz` of a channel without gaps: the same bits wherever made."""
    return start_s + np.arange(count) / rate_hz


@dataclass(frozen=True, slots=True, eq=False)
class Capture:
    """One cycle as measured: an actuator taps a part, it slides and stops.

    `force` is the contact force, positive in compression; `position` and `actuator` are positive along
    the +1 axis, so that a tap with `direction` -1 moves negative. A channel that was not recorded is None.

    Attributes
    ----------
    cycle : int
        The module's cycle number, or the shot number of a campaign.
    time_ns : int
        The cycle's own time, nanoseconds since 1970-01-01 UTC; 0 where it is not known.
    velocity_m_s : float
        Commanded actuator velocity, positive; nan for an excitation without an actuator.
    mass_kg : float
        Mass of the part; nan where it is not known.
    direction : int
        +1 or -1.
    stroke_m : float
        Travel of the actuator from first contact, after which it halts; inf if it never does.
    batch_id : str or None
        Material batch as the PLC names it; None where it says nothing.
    dwell_s : float
        Time the part had been at rest before the tap; nan where it is not known.
    start_m : float
        Position on the table at which the part lay.
    session : int
        Changes when the module has restarted and counts its cycles anew.
    covariates : mapping
        Any further numeric or text column of a campaign.
    summary : Summary or None
        The module's own figures for this cycle, where it reports them.
    """

    cycle: int
    velocity_m_s: float
    mass_kg: float
    force: Channel | None
    position: Channel | None
    actuator: Channel | None = None
    direction: int = 1
    stroke_m: float = float("inf")
    time_ns: int = 0
    batch_id: str | None = None
    dwell_s: float = float("nan")
    start_m: float = 0.0
    session: int = 0
    covariates: Mapping[str, float | str] = field(default_factory=dict)
    summary: "Summary | None" = None


@dataclass(frozen=True, slots=True)
class Summary:
    """The module's own figures: peak force over all contacts, distance slid since the last of them."""

    peak_force_n: float
    sliding_distance_m: float


class Estimator(enum.Enum):
    """Where a published friction coefficient came from."""

    WAVEFORM = "waveform"
    COMBINED = "combined"
    FORCE = "force"
    DISTANCE = "distance"
    NONE = "none"


@dataclass(frozen=True, slots=True)
class Coefficient:
    """A friction coefficient with one standard deviation; nan in both where there is none."""

    value: float = float("nan")
    std: float = float("nan")
    quality: Quality = Quality.BAD
    reason: str = ""


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
    an error of mass, of the force's scale or of the prior on mu_k/mu_s, moves the level as a whole and is in
    the standard deviation of each cycle's estimate only: changes are known better than the level itself.
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


@dataclass(frozen=True, slots=True)
class BatchState:
    """Offset of the present batch from the reference batch, and the last shift found."""

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
        Where along the stroke the deviation is largest; nan without a deviation.
    """

    position_m: Samples
    friction: Samples
    friction_std: Samples
    t_squared: float
    spe: float
    deviates_at_m: float
    quality: Quality
    reason: str = ""


class AlarmName(enum.Enum):
    """The conditions of a cell, by their OPC UA browse names."""

    WEAR_LIMIT = "WearLimit"
    BATCH_SHIFT = "BatchShift"
    DEVIANT_CYCLE = "DeviantCycle"
    MODULE_CONNECTION = "ModuleConnection"
    MODEL_GAP = "ModelGap"
    POSITIONING_FAULT = "PositioningFault"
    JOURNAL_FAULT = "JournalFault"


class Shelving(enum.Enum):
    """Shelved states of OPC UA Part 9, ShelvedStateMachineType."""

    UNSHELVED = "unshelved"
    TIMED = "timed"
    ONE_SHOT = "one_shot"


@dataclass(frozen=True, slots=True)
class Evidence:
    """Why an alarm was raised; nan and 0 where a rule has no such figure.

    Attributes
    ----------
    statistic, threshold : float
        What was compared with what.
    change_cycle : int
        Estimated first cycle after the change.
    size, size_std : float
        Estimated size of the change, in the unit of what is watched.
    false_alarm_cycles, false_alarm_days : float
        Designed mean time between false alarms, in cycles and in days at the present rate.
    """

    statistic: float = float("nan")
    threshold: float = float("nan")
    change_cycle: int = 0
    size: float = float("nan")
    size_std: float = float("nan")
    false_alarm_cycles: float = float("nan")
    false_alarm_days: float = float("nan")


@dataclass(frozen=True, slots=True)
class Alarm:
    """State of one condition after ISA-18.2 / OPC UA Part 9; moved only by `impactcell.alarms`.

    Attributes
    ----------
    severity : int
        1-1000, as in OPC UA.
    cycle, time_ns : int
        Cycle and time of the last transition.
    comment, user : str
        Of the last action by a person.
    """

    name: AlarmName
    enabled: bool = True
    active: bool = False
    acknowledged: bool = True
    confirmed: bool = True
    shelving: Shelving = Shelving.UNSHELVED
    shelved_until_ns: int = 0
    suppressed: bool = False
    out_of_service: bool = False
    severity: int = 500
    message: str = ""
    cycle: int = 0
    time_ns: int = 0
    evidence: Evidence = field(default_factory=Evidence)
    comment: str = ""
    user: str = ""


@dataclass(frozen=True, slots=True)
class PositioningState:
    """A positioning task: where the part should go, what remains, and the tap that comes next."""

    target_m: float = float("nan")
    remaining_m: float = float("nan")
    next_velocity_m_s: float = float("nan")
    next_stroke_m: float = float("nan")
    running: bool = False
    taps: int = 0
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """All that one cycle has to say; what is published and journalled."""

    cycle: int
    time_ns: int
    velocity_m_s: float
    mass_kg: float
    friction: FrictionEstimate
    wear: WearState
    batch: BatchState
    signature: Signature
    positioning: PositioningState
    alarms: tuple[Alarm, ...]
    model_name: str
    gap: float
    gap_quality: Quality = Quality.BAD
