"""An OPC UA server on loopback for tests and benchmarks: cells without a plant, a history in memory."""

import contextlib
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from argon2 import PasswordHasher
from asyncua import Client, ua
from asyncua.crypto import security_policies

from impactcell.alarms import AlarmEvent, EventKind, Message
from impactcell.alarms.lifecycle import transition
from impactcell.opcua.certificates.making import make_certificate, own_hosts, write_pair
from impactcell.records import Alarm, Evidence, Quality, Snapshot
from impactcell.scada import (
    Actor,
    AlarmPage,
    CellDescription,
    HistoryRequest,
    HistoryValue,
    Machine,
    Ranges,
    RefusedError,
    Role,
    SecurityPolicy,
    Server,
    ServerLimits,
    ServerSettings,
    ValuePage,
)
from impactcell.scada.users import User, write_users
from tests.patience import PATIENCE_S
from tests.snapshots import make_capture, make_snapshot

CELL = "press-1"
SERVER_URI = "urn:test:impactcell"
CLIENT_URI = "urn:test:client"
PASSWORDS = {"observer": "observer-pw", "operator": "operator-pw", "engineer": "engineer-pw"}
POLICIES = {
    SecurityPolicy.BASIC256SHA256: security_policies.SecurityPolicyBasic256Sha256,
    SecurityPolicy.AES128_SHA256_RSAOAEP: security_policies.SecurityPolicyAes128Sha256RsaOaep,
    SecurityPolicy.AES256_SHA256_RSAPSS: security_policies.SecurityPolicyAes256Sha256RsaPss,
}
START_NS = 1_780_000_000_000_000_000


PATIENT = {"hello_s": PATIENCE_S, "activation_s": PATIENCE_S}
"""Limits of a server that does not close who is slow."""


class PatientClient(Client):
    """A client that gives up nobody who is slow; another asks each second whether it is answered in one."""

    def __init__(self, endpoint: str) -> None:
        super().__init__(endpoint, timeout=PATIENCE_S, watchdog_intervall=PATIENCE_S)


class MemoryHistory:
    """A `HistorySource` that keeps what it is given; `resume` is the place to read on from."""

    def __init__(self) -> None:
        self.stored: dict[tuple[str, str], list[HistoryValue]] = {}
        self.transitions: dict[str, list[Alarm]] = {}

    async def values(self, cell: str, variable: str, request: HistoryRequest) -> ValuePage:
        return ValuePage(*self._page(self.stored.get((cell, variable), []), request))

    async def alarms(self, cell: str, request: HistoryRequest) -> AlarmPage:
        return AlarmPage(*self._page(self.transitions.get(cell, []), request))

    @staticmethod
    def _page(entries, request: HistoryRequest):
        start_ns, end_ns = request.start_ns, request.end_ns
        found = [
            e
            for e in entries
            if (start_ns is None or e.time_ns >= start_ns) and (end_ns is None or e.time_ns <= end_ns)
        ]
        if request.newest_first:
            found.reverse()
        at = int.from_bytes(request.resume, "big") if request.resume else 0
        stop = at + request.limit
        return tuple(found[at:stop]), stop.to_bytes(8, "big") if stop < len(found) else None


class LifecycleActions:
    """`Actions` on alarms that are kept here, through the life cycle the service uses too."""

    def __init__(self) -> None:
        self.alarms: dict[tuple[str, str], Alarm] = {}
        self.calls: list[tuple[object, ...]] = []
        self.show: Callable[[str, Alarm], None] = lambda _cell, _alarm: None

    def of(self, cell: str, name: str) -> Alarm:
        return self.alarms.get((cell, name), Alarm(name))

    def apply(self, cell: str, name: str, occurrence: AlarmEvent) -> Alarm:
        done = transition(self.of(cell, name), occurrence)
        if done.refusal is not None:
            raise RefusedError(done.refusal.value)
        self.alarms[cell, name] = done.alarm
        self.show(cell, done.alarm)
        return done.alarm

    async def start_batch(self, cell: str, batch_id: str, *, expected: bool, actor: Actor) -> None:
        self.calls.append(("StartBatch", cell, batch_id, expected, actor))

    async def reset_wear(self, cell: str, comment: str, actor: Actor) -> None:
        self.calls.append(("ResetWear", cell, comment, actor))

    async def set_target(self, cell: str, target_m: float, actor: Actor) -> None:
        self.calls.append(("SetTarget", cell, target_m, actor))

    async def abort_positioning(self, cell: str, actor: Actor) -> None:
        self.calls.append(("AbortPositioning", cell, actor))

    async def act_on_condition(
        self,
        cell: str,
        alarm: str,
        event: EventKind,
        actor: Actor,
        *,
        comment: str = "",
        shelve_s: float = 0.0,
        activation: int | None = None,
    ) -> None:
        self.apply(
            cell,
            alarm,
            AlarmEvent(
                event,
                time_ns=time.time_ns(),
                user=actor.user,
                comment=comment,
                shelve_ns=int(shelve_s * 1e9),
                activation=activation,
            ),
        )


@dataclass
class Site:
    """A running server, its files, and what tests do with it."""

    server: Server
    directory: Path
    history: MemoryHistory
    actions: LifecycleActions
    certificate: Path
    key: Path
    cycle: int = 0
    _untrusted: tuple[Path, Path] | None = None

    def publish(self, mu_s: float = 0.2, cell: str = CELL, quality: Quality = Quality.GOOD) -> Snapshot:
        self.cycle += 1
        snapshot = make_snapshot(make_capture(self.cycle, time_ns=START_NS), mu_s)
        if quality is not Quality.GOOD:
            doubtful = replace(snapshot.friction.mu_s, quality=quality)
            snapshot = replace(snapshot, friction=replace(snapshot.friction, mu_s=doubtful))
        self.server.publish(cell, snapshot)
        return snapshot

    def raise_alarm(
        self, name: str = "WearLimit", cell: str = CELL, message: str = "worn", german: str = ""
    ) -> Alarm:
        evidence = Evidence(
            statistic=0.95, threshold=0.9, change_cycle=7, size=0.01, size_std=0.002, false_alarm_cycles=1e5
        )
        return self.actions.apply(
            cell,
            name,
            AlarmEvent(
                EventKind.ACTIVATE,
                self.cycle,
                time.time_ns(),
                message=Message(message, german or message),
                severity=700,
                evidence=evidence,
            ),
        )

    def clear_alarm(self, name: str = "WearLimit", cell: str = CELL) -> Alarm:
        return self.actions.apply(cell, name, AlarmEvent(EventKind.CLEAR, self.cycle, time.time_ns()))

    def untrusted(self) -> tuple[Path, Path]:
        """Certificate and key of a client nobody has trusted yet."""
        if self._untrusted is None:
            pair = make_certificate("stranger", CLIENT_URI, own_hosts())
            self._untrusted = write_pair(self.directory / "stranger", *pair)
        return self._untrusted

    async def client(
        self,
        user: str | None = "observer",
        password: str | None = None,
        policy: SecurityPolicy = SecurityPolicy.BASIC256SHA256,
        certificate: tuple[Path, Path] | None = None,
        endpoint: str | None = None,
    ) -> Client:
        """Client of asyncua, not connected yet."""
        client = PatientClient(endpoint or self.server.endpoint)
        client.application_uri = CLIENT_URI
        if user is not None:
            client.set_user(user)
            client.set_password(PASSWORDS[user] if password is None else password)
        own = certificate or (self.certificate, self.key)
        await client.set_security(
            POLICIES[policy], str(own[0]), str(own[1]), mode=ua.MessageSecurityMode.SignAndEncrypt
        )
        return client

    async def node(self, client: Client, path: str, cell: str = CELL):
        cells = await client.get_namespace_index("urn:impactcell:cells")
        return client.get_node(ua.NodeId(f"{cell}/{path}" if path else cell, cells))


_IDENTITIES: dict[str, object] = {}


def _pair(name: str, uri: str):
    # Keys take long to make; one pair for each role serves all tests of a run.
    if name not in _IDENTITIES:
        _IDENTITIES[name] = make_certificate(name, uri, own_hosts())
    return _IDENTITIES[name]


_USERS: dict[str, User] = {}
QUICK = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
"""How the service hashes takes long, as it must; `tests/unit/opcua/test_trust_list.py` tries that one."""


def users() -> dict[str, User]:
    if not _USERS:
        for role in Role:
            name = role.name.lower()
            _USERS[name] = User(name, role, QUICK.hash(PASSWORDS[name]))
    return dict(_USERS)


@contextlib.asynccontextmanager
async def site(
    cells: Iterable[str] = (CELL,),
    limits: ServerLimits | None = None,
    directory: Path | None = None,
    **settings: object,
) -> AsyncIterator[Site]:
    """Run a server with users `observer`, `operator` and `engineer`, and one trusted client certificate."""
    with tempfile.TemporaryDirectory() as temporary:
        place = directory or Path(temporary)
        if not (place / "pki" / "own").exists():
            write_pair(place / "pki" / "own", *_pair("server", SERVER_URI))
            write_pair(place / "client", *_pair("client", CLIENT_URI))
            (place / "pki" / "trusted").mkdir()
            (place / "pki" / "trusted" / "client.der").write_bytes(
                (place / "client" / "cert.der").read_bytes()
            )
            write_users(place / "users.yaml", users())
        history, actions = MemoryHistory(), LifecycleActions()
        server = Server(
            ServerSettings(
                endpoint="opc.tcp://127.0.0.1:0/impactcell",
                pki=place / "pki",
                application_uri=SERVER_URI,
                limits=limits or ServerLimits(**PATIENT),
                **settings,  # type: ignore[arg-type]
            ),
            place / "users.yaml",
            [
                CellDescription(
                    name,
                    Machine(
                        "Example Works", f"SN-{name}", f"urn:example:{name}", model="IC-1", location="Hall 3"
                    ),
                    Ranges(target_m=(-0.05, 0.05)),
                )
                for name in cells
            ],
            history,
            actions,
        )
        actions.show = server.alarm
        async with server:
            yield Site(
                server, place, history, actions, place / "client" / "cert.der", place / "client" / "key.pem"
            )
