"""A page without a service behind it: the application in this process, asked by a client in this process."""

import asyncio
import re
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from impactcell.process.background import VerbOutcome
from impactcell.records import Alarm
from impactcell.scada import Actor, ConditionAction, RefusedError, Role
from impactcell.scada.conditions import event_id
from impactcell.scada.users import User, Users, write_users
from impactcell.web.app import page_app
from impactcell.web.interface import CellFacts, CellNews, PageContent, PageSettings, TourStop
from impactcell.web.live_feed import LiveFeed
from impactcell.web.sessions import SessionTable
from impactcell.web.studies.queue import RunVerb, StudyQueue
from impactcell.web.studies.study import StudyStore

ADDRESS = "http://127.0.0.1:8480"
CELL = "press-1"
PASSWORD = "right"
NAMES = {Role.OBSERVER: "olga", Role.OPERATOR: "otto", Role.ENGINEER: "eva"}


@dataclass
class Backend:
    """Takes what people do and remembers it."""

    users: Path
    acted: list[tuple[str, str, ConditionAction, Actor]] = field(default_factory=list)
    trusted: list[str] = field(default_factory=list)
    logins: list[tuple[str, str]] = field(default_factory=list)
    changed: list[tuple[str, str, str]] = field(default_factory=list)
    replaced: list[tuple[str, str, str]] = field(default_factory=list)
    refuses: str = ""
    held: asyncio.Event | None = None

    async def log_in(self, name: str, password: str, address: str) -> Actor:
        self.logins.append((name, address))
        user = Users(self.users).find(name)
        if user is None or password != PASSWORD:
            raise RefusedError("BadUserAccessDenied")
        return Actor(name, user.role, address)

    async def act_on_condition(self, cell: str, alarm: str, action: ConditionAction, actor: Actor) -> None:
        if self.refuses:
            raise RefusedError(self.refuses)
        self.acted.append((cell, alarm, action, actor))

    async def accept_model(self, cell: str, extended: Path, actor: Actor) -> str:
        if self.refuses:
            raise RefusedError("BadInvalidState", self.refuses)
        if self.held is not None:
            await self.held.wait()
        self.changed.append((cell, extended.name, actor.user))
        return "extended"

    async def restore_model(self, cell: str, actor: Actor) -> str:
        self.changed.append((cell, "", actor.user))
        return "before"

    async def reset_wear(self, cell: str, comment: str, actor: Actor) -> None:
        if self.refuses:
            raise RefusedError(self.refuses)
        self.replaced.append((cell, comment, actor.user))

    async def trust_certificate(self, thumbprint: str, actor: Actor) -> None:
        if self.refuses:
            raise RefusedError(self.refuses)
        self.trusted.append(thumbprint)


@dataclass
class Verbs:
    """Runs no verb; remembers what it was asked to, and says what it was told to say."""

    outcomes: dict[str, VerbOutcome] = field(default_factory=dict)
    asked: list[list[str]] = field(default_factory=list)
    held: asyncio.Event | None = None
    """While it is there and not set, every verb waits for it."""
    on_run: Callable[[Sequence[str]], None] | None = None
    """Called with what is asked for; writes the files, say."""
    running: int = 0
    most_at_once: int = 0

    async def __call__(
        self, arguments: Sequence[str], timeout_s: float, on_step: Callable[[str], None] | None = None
    ) -> VerbOutcome:
        self.asked.append(list(arguments))
        self.running += 1
        self.most_at_once = max(self.most_at_once, self.running)
        try:
            if on_step is not None:
                on_step(f"doing {arguments[0]}")
            if self.held is not None:
                await self.held.wait()
            if self.on_run is not None:
                self.on_run(arguments)
            return self.outcomes.get(arguments[0], VerbOutcome(0, "{}", ()))
        finally:
            self.running -= 1


class Clock:
    """Seconds that pass when a test says so."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@dataclass
class Page:
    """The application with what it stands on."""

    app: object
    feed: LiveFeed
    backend: Backend
    users: Path
    clock: Clock
    studies: StudyQueue

    def client(self) -> httpx.AsyncClient:
        """A browser of its own: nobody is logged in."""
        return httpx.AsyncClient(transport=httpx.ASGITransport(self.app), base_url=ADDRESS)  # type: ignore[arg-type]

    @asynccontextmanager
    async def logged_in(self, role: Role) -> AsyncIterator[httpx.AsyncClient]:
        async with self.client() as client:
            answer = await log_in(client, NAMES[role], PASSWORD)
            assert answer.status_code == 303, answer.text
            yield client


def raised(message: str = "friction is off", **changes: object) -> Alarm:
    return Alarm(
        "DeviantCycle",
        active=True,
        acknowledged=False,
        message=message,
        cycle=7,
        time_ns=10**18,
        **changes,  # type: ignore[arg-type]
    )


def make_page(
    directory: Path,
    journal: Path | None = None,
    verbs: RunVerb | None = None,
    tour: tuple[TourStop, ...] = (),
    public_url: str | None = None,
) -> Page:
    users = directory / "users.yaml"
    write_users(users, {name: User(name, role, password="x") for role, name in NAMES.items()})
    clock, backend = Clock(), Backend(users)
    studies_dir = directory / "studies"
    settings = PageSettings(ADDRESS, users, directory / "pki", studies_dir, public_url=public_url)
    feed = LiveFeed([CELL])
    feed.start()
    access_files = (("users file", users), ("private key", settings.certificates / "key.pem"))
    facts = CellFacts(
        CELL, "127.0.0.1:502", "opc.tcp://127.0.0.1:4840", journal, tour=tour, access_files=access_files
    )
    studies = StudyQueue(StudyStore(settings.studies), {CELL: directory / "press-1.yaml"}, verbs or Verbs())
    sessions = SessionTable(Users(users), clock)
    app = page_app(settings, PageContent((facts,)), feed, sessions, backend, studies)
    return Page(app, feed, backend, users, clock, studies)


async def put(page: Page, news: CellNews) -> None:
    page.feed.put(news)
    await asyncio.sleep(0)


async def log_in(client: httpx.AsyncClient, user: str, password: str, **fields: str) -> httpx.Response:
    return await client.post("/login", data={"user": user, "password": password, **fields})


async def csrf_of(client: httpx.AsyncClient, path: str = "/") -> str:
    match = re.search(r'name="csrf" value="([^"]+)"', (await client.get(path)).text)
    assert match is not None
    return match[1]


def acknowledgement(alarm: Alarm, **fields: str) -> dict[str, str]:
    return {
        "cell": CELL,
        "alarm": alarm.name,
        "event_id": event_id(CELL, alarm).hex(),
        "action": "acknowledge",
        **fields,
    }
