"""The tap planner: which tap comes next, so that the part ends where it should."""

from impactcell.positioning.belief import Belief
from impactcell.positioning.planner import Tap, TapPlanner, Unreachable

__all__ = ["Belief", "Tap", "TapPlanner", "Unreachable"]
