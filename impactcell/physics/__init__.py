"""The plant: one tap of an actuator on a part that slides and stops, integrated from event to event."""

from impactcell.physics.motion import Event, EventKind, Motion, Sampled
from impactcell.physics.plant import Plant, Strike
from impactcell.physics.tap import strike

__all__ = ["Event", "EventKind", "Motion", "Plant", "Sampled", "Strike", "strike"]
