"""What the OPC UA server is told: its settings, its cells, and what it asks of the rest of the service."""

import enum
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from impactcell.alarms import EventKind
from impactcell.records import Alarm, AlarmName, Quality


class Role(enum.IntEnum):
    """Who a user is; a higher role may all that a lower one may."""

    OBSERVER = 1
    OPERATOR = 2
    ENGINEER = 3


class SecurityPolicy(enum.Enum):
    """Policies the server can offer, all of them sign and encrypt."""

    BASIC256SHA256 = "Basic256Sha256"
    AES128_SHA256_RSAOAEP = "Aes128_Sha256_RsaOaep"
    AES256_SHA256_RSAPSS = "Aes256_Sha256_RsaPss"


@dataclass(frozen=True, slots=True)
class Limits:
    """How much one server takes on; what is beyond is refused with the status code of the standard."""

    connections: int = 250
    sessions: int = 100
    subscriptions: int = 500
    subscriptions_per_session: int = 20
    items_per_subscription: int = 2_000
    queue_per_item: int = 10_000
    events_per_item: int = 1_000
    message_bytes: int = 4 * 1024 * 1024
    session_timeout_s: float = 600.0
    publishing_interval_s: float = 0.01
    hello_s: float = 5.0
    activation_s: float = 15.0


def default_application_uri() -> str:
    """Application URI of this machine's server; the certificate must carry the same."""
    return f"urn:{socket.gethostname()}:impactcell"


@dataclass(frozen=True, slots=True)
class ServerSettings:
    """How the server is reached and who may come in.

    Attributes
    ----------
    endpoint : str
        `opc.tcp://host:port/path`; port 0 takes a free one.
    pki : Path
        Directory of the server's certificate and of the trust list (see `impactcell certs make`).
    users : Path
        Users file (see `impactcell users add`); read anew when it changes.
    allow_none : bool
        True allows sessions without encryption. Every start then logs a warning.
    """

    endpoint: str
    pki: Path
    users: Path
    policies: tuple[SecurityPolicy, ...] = tuple(SecurityPolicy)
    allow_none: bool = False
    application_uri: str = field(default_factory=default_application_uri)
    limits: Limits = field(default_factory=Limits)


@dataclass(frozen=True, slots=True)
class Machine:
    """Nameplate of a machine after OPC 40001-1; None leaves a node out."""

    manufacturer: str
    serial_number: str
    product_instance_uri: str
    model: str | None = None
    manufacturer_uri: str | None = None
    product_code: str | None = None
    hardware_revision: str | None = None
    software_revision: str | None = None
    device_class: str | None = None
    asset_id: str | None = None
    component_name: str | None = None
    location: str | None = None
    year_of_construction: int | None = None
    month_of_construction: int | None = None


@dataclass(frozen=True, slots=True)
class Ranges:
    """Ranges the values of a cell are expected in, SI units: EURange, and the bounds of `SetTarget`."""

    friction: float = 1.0
    force_n: float = 500.0
    velocity_m_s: float = 0.2
    sliding_distance_m: float = 0.01
    stroke_m: float = 0.1
    target_m: tuple[float, float] = (-1.0, 1.0)


@dataclass(frozen=True, slots=True)
class CellDescription:
    """One cell as the server shows it; `name` is its browse name and the root of its NodeIds."""

    name: str
    machine: Machine
    ranges: Ranges = field(default_factory=Ranges)


@dataclass(frozen=True, slots=True)
class Actor:
    """Who acts: the user as logged in, the role, and the client's address."""

    user: str
    role: Role
    address: str


class RefusedError(Exception):
    """An action that was refused; nothing has changed.

    Parameters
    ----------
    code : str
        Name of the OPC UA status code, as `impactcell.alarms.Refusal` and `BadOutOfRange` give it.
    """

    def __init__(self, code: str, reason: str = "") -> None:
        super().__init__(reason or code)
        self.code = code


class Actions(Protocol):
    """The service, as OPC UA methods reach it. Every call may raise `RefusedError`."""

    async def start_batch(self, cell: str, batch_id: str, *, expected: bool, actor: Actor) -> None:
        """Begin another batch of material."""

    async def reset_wear(self, cell: str, comment: str, actor: Actor) -> None:
        """Learn the wear level anew after worn parts were replaced."""

    async def set_target(self, cell: str, target_m: float, actor: Actor) -> None:
        """Start a positioning task."""

    async def abort_positioning(self, cell: str, actor: Actor) -> None:
        """End the positioning task that runs."""

    async def act_on_condition(
        self,
        cell: str,
        alarm: AlarmName,
        event: EventKind,
        actor: Actor,
        *,
        comment: str = "",
        shelve_s: float = 0.0,
    ) -> Alarm:
        """Apply a person's action through `impactcell.alarms.apply_event`; the new state of the condition.

        The action is one of acknowledge, confirm, comment, enable, disable and the three of shelving. A
        `Transition` that carries a refusal is raised as `RefusedError(refusal.value)`.
        """


@dataclass(frozen=True, slots=True)
class HistoryValue:
    """One stored value of a variable, in the unit of its node."""

    time_ns: int
    value: float
    quality: Quality = Quality.GOOD


@dataclass(frozen=True, slots=True)
class ValuePage:
    """Part of a history; `resume` is handed back to read on, None where nothing is left."""

    values: Sequence[HistoryValue]
    resume: bytes | None = None


@dataclass(frozen=True, slots=True)
class AlarmPage:
    """Part of the history of alarms, as the states that each transition led to."""

    alarms: Sequence[Alarm]
    resume: bytes | None = None


class HistorySource(Protocol):
    """Where the past is kept. Times are nanoseconds since 1970, both ends inclusive, None is open.

    `newest_first` reverses the order. A page holds at most `limit` entries; `resume` continues an earlier
    page of the same question and stays valid over restarts. Every call may raise `RefusedError`.
    """

    async def values(
        self,
        cell: str,
        variable: str,
        start_ns: int | None,
        end_ns: int | None,
        limit: int,
        *,
        newest_first: bool = False,
        resume: bytes | None = None,
    ) -> ValuePage:
        """Read stored values of a variable, named by its path, as `Friction/StaticFriction`."""

    async def alarms(
        self,
        cell: str,
        start_ns: int | None,
        end_ns: int | None,
        limit: int,
        *,
        newest_first: bool = False,
        resume: bytes | None = None,
    ) -> AlarmPage:
        """Read transitions of the conditions of a cell."""
