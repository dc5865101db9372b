"""Shift from batch to batch: one factor of mu a batch, the first batch is the reference."""

from collections.abc import Sequence

from simulator.effects.law import Effect, Shot


class BatchShift(Effect):
    """Both coefficients differ from batch to batch; a batch beyond the list is like the last of it."""

    identifier = "batch_shift"
    defaults = {"relative_change": (0.06,)}

    def __init__(self, relative_change: Sequence[float]) -> None:
        self._changes = tuple(relative_change)

    def shot_factor(self, shot: Shot) -> float:
        if shot.batch == 0 or not self._changes:
            return 1.0
        return 1.0 + self._changes[min(shot.batch, len(self._changes)) - 1]
