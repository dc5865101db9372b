"""Wear and batch: the level of friction over cycles and material, and when the material changed."""

from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import (
    FrictionObservation,
    TrackerState,
    TrackingResult,
    initial_state,
    reset_wear_level,
)
from impactcell.tracking.wear_batch.state_reports import present_friction
from impactcell.tracking.wear_batch.tracker import update

__all__ = [
    "BatchKnowledge",
    "FrictionObservation",
    "TrackerSettings",
    "TrackerState",
    "TrackingResult",
    "initial_state",
    "present_friction",
    "reset_wear_level",
    "update",
]
