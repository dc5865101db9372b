"""All that one cycle has to say."""

from dataclasses import dataclass

from impactcell.records.alarm import Alarm
from impactcell.records.friction import BatchState, FrictionEstimate, Quality, Signature, WearState


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
