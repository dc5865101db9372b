"""The parts that come to a positioning cell one after the other, as its PLC sees them. Pure."""

import math
from collections.abc import Mapping
from typing import Any

from simulator.scenario import Scenario, Task


class PartSequence:
    """Which part lies on the table, where, and when the next one comes.

    Attributes
    ----------
    part : Task
        The part on the table and where it should go.
    position_m : float
        Where it lies.
    number : int
        Counts the parts from 1; 0 where the scenario has no tasks.
    due_s : float
        When the next part comes; inf while this one is being worked on.
    """

    def __init__(self, scenario: Scenario, now_s: float) -> None:
        self._scenario = scenario
        positioning = scenario.positioning
        self._tasks = [] if positioning is None else positioning.tasks
        self.number = 0
        self.part = Task(target_m=0.0, mass_kg=scenario.part.mass_kg)
        self.position_m = 0.0
        self.due_s = math.inf
        self._taps = 0
        self._outcomes: list[Mapping[str, Any]] = []
        if self._tasks:
            self.advance(now_s)

    def advance(self, now_s: float) -> None:  # noqa: ARG002 - the time is the caller's to know
        """Take the part away and put the next one down."""
        self.due_s = math.inf
        if self.number < len(self._tasks):
            self.part = self._tasks[self.number]
            self.position_m = self.part.start_m
            self.number += 1
            self._taps = 0

    def moved(self, position_m: float, now_s: float) -> None:
        """Note where the part came to rest after a tap."""
        self.position_m = position_m
        self._taps += 1
        positioning = self._scenario.positioning
        if positioning is None or not self.number or math.isfinite(self.due_s):
            return
        remaining = self.part.target_m - position_m
        inside = abs(remaining) <= self.part.tolerance_m
        back = -1 if self.part.target_m >= self.part.start_m else 1
        beyond = not inside and remaining * back > 0.0
        if inside or self._taps >= self.part.most_taps or (beyond and back not in positioning.directions):
            self._outcomes.append(
                {
                    "task": self.number,
                    "target_m": self.part.target_m,
                    "position_m": position_m,
                    "mass_kg": self.part.mass_kg,
                    "taps": self._taps,
                    "inside": inside,
                    "overshot": beyond,
                }
            )
            more = self.number < len(self._tasks)
            self.due_s = now_s + positioning.pause_s if more else math.inf

    def outcomes(self) -> list[Mapping[str, Any]]:
        """Return what became of parts since the last call."""
        outcomes, self._outcomes = self._outcomes, []
        return outcomes
