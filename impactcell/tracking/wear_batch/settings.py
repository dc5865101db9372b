"""What a cell may choose about tracking; everything else is learned from its data."""

import enum
import math
from dataclasses import dataclass


class BatchKnowledge(enum.Enum):
    """Whether the PLC's batch ids are to be used."""

    KNOWN = "known"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class TrackerSettings:
    """Settings of the tracker; stds and variances of friction are relative to one estimate's variance.

    Attributes
    ----------
    wear_limit : float
        mu_s at the reference batch at which the surface is worn; inf for none.
    horizon_cycles : float
        Cycles that are looked ahead at the limit, but no more than have been seen.
    batch : BatchKnowledge
        KNOWN: the batch id of each cycle is believed, a change within a batch is looked for all the same,
        and cycles without an id fall back on the bank.
        UNKNOWN: ids are ignored.
    false_alarm_cycles : float
        Designed mean number of cycles between false batch alarms.
    hazard : float
        Prior probability of an unannounced batch change a cycle.
    step_std : float
        Prior standard deviation of a batch step, in standard deviations of one estimate.
    slope_std : float
        Prior standard deviation of the wear a cycle, in the same unit.
    outlier_probability : float
        Prior probability that an estimate is an outlier; how many there are is learned.
    outlier_threshold : float
        Huber's threshold, in standard deviations of the innovation.
    commissioning_cycles : int
        Cycles from which the process noise is learned; what they do not show, the banks that run side by side
        from then on will.
    commissioning_delay : int
        By so many cycles random walks are looked for later than else, and commissioning ends later. What is
        found there takes as long as several cycles; cells of one service that were begun together would all
        be at it in the same half second, and other cycles would wait.
    level_noise, slope_noise : float
        Process noise to start from: standard deviation a cycle of the random walks of level and slope,
        in standard deviations of one estimate.
    identical_limit : int
        So many identical values in a row and more are a stuck sensor, not measurements.
    reorder_limit : int
        A cycle that comes at most this many cycles late is still used at its own place.
    """

    wear_limit: float = math.inf
    horizon_cycles: float = 2000.0
    batch: BatchKnowledge = BatchKnowledge.KNOWN
    false_alarm_cycles: float = 100_000.0
    hazard: float = 3e-3
    step_std: float = 4.0
    slope_std: float = 0.1
    outlier_probability: float = 0.001
    outlier_threshold: float = 2.5
    commissioning_cycles: int = 200
    commissioning_delay: int = 0
    level_noise: float = 0.0
    slope_noise: float = 0.0
    identical_limit: int = 5
    reorder_limit: int = 64
