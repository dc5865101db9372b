"""The tap planner: which tap comes next, so that the part ends where it should."""

from impactcell.positioning.planner import TapPlanner
from impactcell.positioning.planner_posterior import PlannerPosterior
from impactcell.positioning.safety_limits import SafetyLimits
from impactcell.positioning.tap import Tap, Unreachable

__all__ = ["PlannerPosterior", "SafetyLimits", "Tap", "TapPlanner", "Unreachable"]
