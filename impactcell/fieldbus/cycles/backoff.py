"""How long to wait before connecting again."""

import random
from typing import Final

FIRST_S: Final = 0.02
"""Longest first delay, seconds: a module that restarts is back within some tens of milliseconds."""
CEILING_S: Final = 0.4
"""Longest delay, seconds: what a first cycle may cost after the link is back."""


class Backoff:
    """Doubling delays up to a low ceiling, each drawn from its upper half.

    The jitter keeps the cells of a plant from knocking all at once when a switch comes back; the low ceiling
    is what a first cycle may cost after the link is back.
    """

    def __init__(self, draw: random.Random | None = None) -> None:
        self._random = draw if draw is not None else random.Random()  # noqa: S311 - jitter, not secret
        self._bound_s = FIRST_S

    def next_delay_s(self) -> float:
        """Return the least time from this attempt to the next; it grows with each call."""
        delay_s = self._bound_s * self._random.uniform(0.5, 1.0)
        self._bound_s = min(2.0 * self._bound_s, CEILING_S)
        return delay_s

    def reset(self) -> None:
        """Begin anew, after a success."""
        self._bound_s = FIRST_S
