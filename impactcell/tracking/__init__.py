"""Friction over time (wear), over batches (material) and along one stroke (signature)."""

from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import Reading, Tracked, TrackerState, initial_state, reset_wear
from impactcell.tracking.wear_batch.tracker import track

__all__ = [
    "BatchKnowledge",
    "Reading",
    "Tracked",
    "TrackerSettings",
    "TrackerState",
    "initial_state",
    "reset_wear",
    "track",
]
