"""What every transport offers to the client above it."""

from collections.abc import Sequence
from typing import Protocol

from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.request_batching import RequestBatch
from impactcell.fieldbus.transports.request_window import RequestWindow


class Transport(Protocol):
    """Carries requests to one device and brings its replies back.

    What is above knows no frames, sockets or timers. A transport holds these promises, which every
    one of them is held to by the same tests:

    - a reply is used only if it is a good one to its request; at the first that is not, and at a timeout, all
      that is pending fails and the connection is given up, so that what still comes is never taken for an
      answer;
    - data of good replies is put into the block of their batch, also where the exchange fails later;
    - an exchange ends once: when all its requests are answered, with the exception of a device that refuses
      one, or with LinkError or ProtocolError when the connection is lost;
    - a device that is busy is asked again until the timeout has passed.
    """

    @property
    def link(self) -> ModuleLink:
        """How the device is reached."""

    @property
    def window(self) -> RequestWindow:
        """How many requests may be in flight."""

    @property
    def connected(self) -> bool:
        """Whether requests can be sent."""

    @property
    def round_trip_s(self) -> float:
        """Time between the last request and its reply; nan before the first."""

    async def connect(self) -> None:
        """Open the connection, unless it is open; raises LinkError if it cannot be made in time."""

    async def close(self) -> None:
        """Close the connection and wait until it is gone; all that is pending fails."""

    def submit(self, batches: Sequence[RequestBatch], *, first: bool = False) -> None:
        """Send requests in order, `first` before all that waits; raises LinkError without a connection."""
