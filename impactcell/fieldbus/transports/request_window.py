"""How many requests may be in flight: as the settings say, or found by trials.

A device may answer one request after the other, or drop, mix up or refuse what it is asked meanwhile, or
close the connection; nothing says beforehand which. So a connection begins with one request in flight, and
then trials are made, of requests for whose replies nobody waits. They all differ in length, so that a reply
to another request shows. A device that fails one of few is asked one request at a time from then on; one
that fails with many more keeps the few.
"""

from typing import Final

FEW: Final = 16
"""Requests in flight up to which a device that cannot stand them is not believed with several at all: what it
mixes up or drops it may mix up or drop with two. Beyond, its queue is full."""
TRIAL_SIZES: Final = (2, FEW, 64)
"""Requests in flight in the trials: first the fewest, for a device that cannot stand them. The most is what a
capture gains from: 228 replies then come in four batches instead of fifteen."""
_MOST_FAILURES: Final = 3
"""Connections that a device which has passed may lose with several requests in flight: as often it is the
link; without `_PROVED_REPLIES` between them it is the device."""
_MOST_UNDECIDED: Final = 3
"""Trials during which a device may be busy, or refuse what is asked, one after the other."""
_PROVED_REPLIES: Final = 1000
"""Good replies after which earlier failures are forgotten: five captures or more."""


class RequestWindow:
    """Requests in flight at most, over all connections to a device.

    Parameters
    ----------
    pinned : int or None
        As the settings say; None: found by trials.
    reason : str
        Why it is pinned, in words.

    Attributes
    ----------
    size : int
        Requests in flight at most, now.
    most : int
        Of the trials that may be made.
    answered : int
        Good replies since the last failure, with several requests in flight or one.
    given_up : str
        Why only one is allowed for good; empty as long as that is not so.
    """

    __slots__ = ("_failures", "_pinned", "_reason", "_undecided", "answered", "given_up", "most", "size")

    def __init__(self, pinned: int | None = None, reason: str = "as set") -> None:
        self.size = pinned or 1
        self.most = TRIAL_SIZES[-1]
        self.answered = 0
        self.given_up = ""
        self._failures: int | None = None
        self._undecided = 0
        self._pinned = pinned
        self._reason = reason

    def __str__(self) -> str:
        """How many and why, for messages."""
        if self.given_up:
            return f"1 for good: {self.given_up}"
        return f"{self.size}, {self._reason if self._pinned else 'found by trial'}"

    @property
    def untried(self) -> bool:
        """Whether trials may find more."""
        return self._pinned is None and not self.given_up and self.size == 1

    def begin_connection(self) -> None:
        """Allow what a device may be asked at the beginning of a connection."""
        self.size = self._pinned or 1

    def accept_trials(self) -> None:
        """Take it that the device has passed all trials of this connection."""
        self._failures = self._failures or 0
        self._undecided = 0

    def leave_undecided(self, reason: str) -> None:
        """Take it that a trial said nothing: the device may have been busy with something else.

        If it was one of many, that was too many.
        """
        if self.size > FEW:
            self._allow_fewer(reason)
            self.accept_trials()
            return
        self.begin_connection()
        self._undecided += 1
        if self._undecided >= _MOST_UNDECIDED:
            self.give_up(reason)

    def fail(self, reason: str) -> None:
        """Take it that a connection was lost with several requests in flight."""
        if self._failures is None:
            self._allow_fewer(reason)
            return
        self._failures = 1 + (self._failures if self.answered < _PROVED_REPLIES else 0)
        self.answered = 0
        if self._failures >= _MOST_FAILURES:
            self._allow_fewer(reason)

    def give_up(self, reason: str) -> None:
        """Allow one request for good, unless the settings say how many."""
        if self._pinned is None and not self.given_up:
            self.given_up, self.size = reason, 1

    def _allow_fewer(self, reason: str) -> None:
        """Allow few requests where it was with many, else one for good; unless the settings say how many."""
        if self._pinned is None and self.size > FEW:
            self.most = self.size = FEW
            self._failures = None if self._failures is None else 0
        else:
            self.give_up(reason)
