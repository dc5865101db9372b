"""All that one cycle has to say."""

from dataclasses import dataclass, field

from impactcell.records.alarm import Alarm, Evidence
from impactcell.records.friction import BatchState, FrictionEstimate, Quality, Signature, WearState


@dataclass(frozen=True, slots=True)
class TapPredictions:
    """What the taps so far say of the planner's model.

    Attributes
    ----------
    taps : int
        Learned from; of displacements that are off without a pattern, those over which they have been.
    lacking : bool
        The model lacks something, beyond chance.
    depends_on : str
        What the displacements that it misses depend on most: velocity, mass, position, contact, direction;
        empty where they are off without a pattern.
    evidence : Evidence
        Logarithm of the evidence and of its threshold, and the share of a displacement that is missed.
    """

    taps: int = 0
    lacking: bool = False
    depends_on: str = ""
    evidence: Evidence = field(default_factory=Evidence)


@dataclass(frozen=True, slots=True)
class PositioningState:
    """A positioning task: where the part should go, what remains, the tap that comes next, and its model."""

    target_m: float = float("nan")
    remaining_m: float = float("nan")
    next_velocity_m_s: float = float("nan")
    next_stroke_m: float = float("nan")
    running: bool = False
    taps: int = 0
    reason: str = ""
    predictions: TapPredictions = field(default_factory=TapPredictions)


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
