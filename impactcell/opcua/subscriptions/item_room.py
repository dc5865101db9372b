"""How many monitored items one user may have in all sessions."""

from dataclasses import dataclass

from asyncua import ua

from impactcell.opcua.binary_codec import StatusCodeError


@dataclass(slots=True)
class ItemRoom:
    """How many more monitored items a user may have, and how many of them may report events."""

    items: int
    events: int

    def take(self, *, events: bool) -> None:
        """Take room for one.

        Raises
        ------
        StatusCodeError
            BadTooManyMonitoredItems.
        """
        if self.items <= 0 or (events and self.events <= 0):
            raise StatusCodeError(ua.StatusCodes.BadTooManyMonitoredItems)
        self.items -= 1
        self.events -= events
