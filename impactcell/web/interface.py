"""What the page is told of the cells, and what it asks of the service behind it."""

import enum
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

from impactcell.alarms import Message
from impactcell.records import Alarm, Capture, ModuleStatus, Snapshot
from impactcell.scada import Actor, ConditionAction


class Freshness(enum.Enum):
    """Whether the values of a cell are of now; before its module was asked for the first time none are.

    That takes seconds (starting), on a new machine minutes (compiling).
    """

    STARTING = "starting"
    COMPILING = "compiling"
    LIVE = "live"
    STALE = "stale"
    LOST = "lost"


@dataclass(frozen=True, slots=True)
class CellNews:
    """One thing that happened in a cell; what is None, or empty, is as it was.

    A capture comes together with the snapshot that was made of it.
    """

    cell: str
    snapshot: Snapshot | None = None
    capture: Capture | None = None
    status: ModuleStatus | None = None
    alarms: tuple[Alarm, ...] = ()
    freshness: Freshness | None = None


@dataclass(frozen=True, slots=True)
class TourStop:
    """Something that a demo has in store: from which cycle on, what happens, and where to look.

    What waits for the reader has no cycle (None): nobody but the reader knows when it is done.
    """

    cycle: int | None
    what: Message
    where: Message


@dataclass(frozen=True, slots=True)
class CellFacts:
    """What does not change of a cell while the service runs.

    Attributes
    ----------
    name : str
    module : str
        Address of its module.
    endpoint : str
        Where OPC UA clients find it.
    journal : Path or None
        Its journal file.
    file : Path or None
        Its cell file, which says which model it runs with.
    stroke_m : float or None
        Stroke of its actuator from first contact on, where it is the same for every tap.
    has_positioning : bool
        Whether it places parts, beside watching.
    tour : sequence of TourStop
        What happens in a cell that is a demo; empty in a real one.
    access_files : sequence of str and Path
        Files that grant access, each with what it is: `users file` or `private key`.
    """

    name: str
    module: str
    endpoint: str
    journal: Path | None = None
    file: Path | None = None
    stroke_m: float | None = None
    has_positioning: bool = False
    tour: Sequence[TourStop] = ()
    access_files: Sequence[tuple[str, Path]] = ()


@dataclass(frozen=True, slots=True)
class PageSettings:
    """How the page is reached and who may look at it.

    Attributes
    ----------
    endpoint : str
        `http://host:port` or `https://host:port`; port 0 takes a free one.
    users, certificates : Path
        Users file and directory of certificates, those of OPC UA.
    studies : Path
        Directory for what people drop, and what comes out of it.
    certificate, key : Path or None
        Of the page itself, PEM, for https.
    public_url : str or None
        Address in the browser where a proxy is before the page, as in `https://cells.plant.example`.
    """

    endpoint: str
    users: Path
    certificates: Path
    studies: Path
    certificate: Path | None = None
    key: Path | None = None
    public_url: str | None = None

    @property
    def is_encrypted(self) -> bool:
        """Whether browsers reach it over TLS."""
        return urlsplit(self.public_url or self.endpoint).scheme == "https"


class PageBackend(Protocol):
    """The service as the page reaches it; a coroutine that raises `RefusedError` has changed nothing."""

    async def log_in(self, name: str, password: str, address: str) -> Actor:
        """Find out who a password stands for; guessing is slowed down."""

    async def act_on_condition(self, cell: str, alarm: str, action: ConditionAction, actor: Actor) -> None:
        """Acknowledge, confirm, comment, shelve or unshelve an alarm, as over OPC UA."""

    async def reset_wear(self, cell: str, comment: str, actor: Actor) -> None:
        """Learn the wear level anew after worn parts were replaced, as over OPC UA."""

    async def trust_certificate(self, thumbprint: str, actor: Actor) -> None:
        """Let a client connect whose certificate has been refused."""

    async def accept_model(self, cell: str, extended: Path, actor: Actor) -> str:
        """Put an extended model into service, as `impactcell model accept` does; returns its name."""

    async def restore_model(self, cell: str, actor: Actor) -> str:
        """Put the model back into service that the last one has replaced; returns its name."""


@dataclass(frozen=True, slots=True)
class PageContent:
    """What a page is about: its cells, in the order in which they are shown."""

    cells: Sequence[CellFacts] = field(default_factory=tuple)

    def find(self, name: str) -> CellFacts | None:
        """Find a cell by name."""
        return next((cell for cell in self.cells if cell.name == name), None)
