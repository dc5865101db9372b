"""The nouns of impactcell: what flows from the module to SCADA, as frozen values in SI units.

A `Capture` comes in; `FrictionEstimate`, `WearState`, `BatchState`, `Signature` and `Alarm` are made
from it; a `Snapshot` holds them together for one cycle and is what is published and journalled.
"""

from impactcell.records.alarm import LARGEST_STATISTIC, Alarm, Evidence, Shelving
from impactcell.records.capture import (
    AT_THE_HALT_S,
    FORCE_SCALE_STD,
    MASS_STD,
    POSITION_SCALE_STD,
    VELOCITY_STD,
    Capture,
    Channel,
    Samples,
    Summary,
    as_recorded,
    sampling_step_s,
    since_contact,
    uniform_times,
    with_open_onset,
)
from impactcell.records.correlated_noise import CorrelatedNoise, SharedPart
from impactcell.records.friction import (
    BatchState,
    Coefficient,
    Estimator,
    FrictionEstimate,
    Quality,
    Signature,
    WearState,
)
from impactcell.records.module import NOT_CONNECTED_YET, BatchAnnouncement, CycleId, ModuleStatus
from impactcell.records.snapshot import PositioningState, Snapshot, TapPredictions
from impactcell.records.units import MM_PER_MIN

__all__ = [
    "AT_THE_HALT_S",
    "FORCE_SCALE_STD",
    "LARGEST_STATISTIC",
    "MASS_STD",
    "MM_PER_MIN",
    "NOT_CONNECTED_YET",
    "POSITION_SCALE_STD",
    "VELOCITY_STD",
    "Alarm",
    "BatchAnnouncement",
    "BatchState",
    "Capture",
    "Channel",
    "Coefficient",
    "CorrelatedNoise",
    "CycleId",
    "Estimator",
    "Evidence",
    "FrictionEstimate",
    "ModuleStatus",
    "PositioningState",
    "Quality",
    "Samples",
    "SharedPart",
    "Shelving",
    "Signature",
    "Snapshot",
    "Summary",
    "TapPredictions",
    "WearState",
    "as_recorded",
    "sampling_step_s",
    "since_contact",
    "uniform_times",
    "with_open_onset",
]
