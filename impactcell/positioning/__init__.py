"""The tap planner: which tap comes next, so that the part ends where it should."""
