"""What this OPC UA server is told by its host, and what it asks of it.

The host brings an address space, the methods that can be called, and the three answers below: who a user is,
what a role may do, what was. This module imports nothing of asyncua, so that it is read quickly.
"""

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from asyncua import ua

    from impactcell.opcua.event_notification import EventNotification


class Role(enum.IntEnum):
    """Well-known roles (Part 18, 4.2) that are told apart; a higher one may all that a lower one may."""

    OBSERVER = 1
    OPERATOR = 2
    ENGINEER = 3


class Permission(enum.Enum):
    """What can be done to a node (`PermissionType` of Part 3, 8.55, as far as it is offered)."""

    BROWSE = "browse"
    READ = "read"
    SUBSCRIBE = "subscribe"
    WRITE = "write"
    READ_HISTORY = "read history"
    CALL = "call"


class SecurityPolicy(enum.Enum):
    """Policies the server can offer, all of them sign and encrypt (Part 7, 6.6.161 and following)."""

    BASIC256SHA256 = "Basic256Sha256"
    AES128_SHA256_RSAOAEP = "Aes128_Sha256_RsaOaep"
    AES256_SHA256_RSAPSS = "Aes256_Sha256_RsaPss"


@dataclass(frozen=True, slots=True)
class ServerLimits:
    """How much one server takes on; what is beyond is refused with the status code of the standard.

    Attributes
    ----------
    connections, sessions, subscriptions : int
        In all.
    connections_per_address, sessions_per_user : int
        Of these, for one client's address and for one user: nobody can hold all of them alone.
    subscriptions_per_session, items_per_subscription : int
    items_per_user, event_items_per_user : int
        Monitored items of all sessions of one user, and those of them that report events.
    queue_per_item, events_per_item : int
        Longest queue of a data item, and of an event item.
    message_bytes : int
        Longest request.
    session_timeout_s : float
        Longest time a session lives unheard.
    publishing_interval_s : float
        Shortest publishing interval.
    hello_s, activation_s : float
        Time a new connection has for its Hello, and then for a session.
    undisturbed_s : float
        Time that it has, as has a session that nobody has logged in to, before it may have to give way to a
        newcomer.
    """

    connections: int = 250
    connections_per_address: int = 150
    sessions: int = 100
    sessions_per_user: int = 60
    subscriptions: int = 500
    subscriptions_per_session: int = 20
    items_per_subscription: int = 2_000
    items_per_user: int = 10_000
    event_items_per_user: int = 100
    queue_per_item: int = 10_000
    events_per_item: int = 1_000
    message_bytes: int = 1024 * 1024
    session_timeout_s: float = 600.0
    publishing_interval_s: float = 0.01
    hello_s: float = 5.0
    activation_s: float = 15.0
    undisturbed_s: float = 1.0


@dataclass(frozen=True, slots=True)
class ServerSettings:
    """How the server is reached and how it is secured.

    Attributes
    ----------
    endpoint : str
        `opc.tcp://host:port/path`; port 0 takes a free one.
    application_uri : str
        The server's own URI; its certificate carries the same.
    pki : Path
        Directory of the server's certificate and of the trust list (see `trust_list`).
    allow_none : bool
        True allows sessions without encryption. Every start then logs a warning.
    """

    endpoint: str
    application_uri: str
    pki: Path
    policies: tuple[SecurityPolicy, ...] = tuple(SecurityPolicy)
    allow_none: bool = False
    limits: ServerLimits = field(default_factory=ServerLimits)


@dataclass(frozen=True, slots=True)
class Product:
    """What the server calls itself in its `BuildInfo` and its endpoints."""

    name: str
    uri: str
    version: str


@dataclass(frozen=True, slots=True)
class Actor:
    """Who acts: the user as logged in, the role, and the client's address."""

    user: str
    role: Role
    address: str


class RefusedError(Exception):
    """A request that the host refuses; nothing has changed.

    Parameters
    ----------
    code : str
        Name of the OPC UA status code, such as `BadOutOfRange`.
    """

    def __init__(self, code: str, reason: str = "") -> None:
        super().__init__(reason or code)
        self.code = code


class RegisteredUser(Protocol):
    """A user who may log in."""

    @property
    def name(self) -> str:
        """Name to log in by."""

    @property
    def role(self) -> Role:
        """What the user may do."""


class UserDirectory(Protocol):
    """Who may log in. Every call but `verify_password` is made on the event loop and returns at once."""

    def find(self, name: str) -> RegisteredUser | None:
        """Find a user by name, as of now."""

    def find_by_certificate(self, fingerprint: str) -> RegisteredUser | None:
        """Find a user by the SHA-256 fingerprint of a certificate, capital hexadecimal."""

    def verify_password(self, user: RegisteredUser | None, password: str) -> bool:
        """Check a password, as slowly for a user who does not exist; called in a thread."""


class AccessPolicy(Protocol):
    """What a role may do."""

    def permits(self, role: Role, permission: Permission, node: "ua.NodeId") -> bool:
        """Whether a role has a permission on a node; for `CALL` the node is the method."""


class AuditLog(Protocol):
    """What people have done."""

    def method_called(self, actor: Actor, request: "ua.CallMethodRequest", status: int, reason: str) -> None:
        """Write down the call of a method, refused ones too; `reason` is in words, or empty."""


@dataclass(frozen=True, slots=True)
class HistoryRequest:
    """Which part of the past is wanted: nanoseconds since 1970, both ends inclusive, None is open.

    Attributes
    ----------
    limit : int
        Entries in a page, at most.
    newest_first : bool
        Reverses the order.
    resume : bytes or None
        Continues an earlier page of the same request; it stays valid over restarts.
    """

    start_ns: int | None
    end_ns: int | None
    limit: int
    newest_first: bool = False
    resume: bytes | None = None


@dataclass(frozen=True, slots=True)
class HistoricalValue:
    """One stored value, None where there is none; `status` is an OPC UA status code."""

    time_ns: int
    value: float | None
    status: int = 0


@dataclass(frozen=True, slots=True)
class HistoricalValues:
    """A page of stored values; `resume` is handed back to read on, None where nothing is left."""

    values: Sequence[HistoricalValue]
    resume: bytes | None = None


@dataclass(frozen=True, slots=True)
class HistoricalEvents:
    """A page of stored events; `resume` is handed back to read on, None where nothing is left."""

    events: "Sequence[EventNotification]"
    resume: bytes | None = None


class HistoryProvider(Protocol):
    """Where the past is kept. The two reads may raise `RefusedError`."""

    def has_values(self, node: "ua.NodeId") -> bool:
        """Whether a variable has a history."""

    def has_events(self, node: "ua.NodeId") -> bool:
        """Whether a notifier has a history of events."""

    async def read_values(self, node: "ua.NodeId", request: HistoryRequest) -> HistoricalValues:
        """Read stored values of a variable that has a history."""

    async def read_events(self, node: "ua.NodeId", request: HistoryRequest) -> HistoricalEvents:
        """Read stored events of a notifier that has a history of them."""


@dataclass(frozen=True, slots=True)
class Host:
    """All that the server asks of whom it serves."""

    product: Product
    users: UserDirectory
    access: AccessPolicy
    audit: AuditLog
    history: HistoryProvider
    translations: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """Of each language but English, its texts by the English ones."""
