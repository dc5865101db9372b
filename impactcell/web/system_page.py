"""The system: links, journals, users, and certificates that wait to be trusted."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cryptography.x509 import Certificate
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from impactcell.alarms.rules import journal_fault
from impactcell.errors import AccessError
from impactcell.opcua.certificates.certificate_files import der, read_certificate, thumbprint
from impactcell.process.file_access import what_others_can
from impactcell.records import Alarm, ModuleStatus
from impactcell.scada import RefusedError, Role
from impactcell.scada.users import User, read_users
from impactcell.web.cell_view import CellView
from impactcell.web.interface import CellFacts, Freshness
from impactcell.web.page_context import PageContext
from impactcell.web.requests import RequestRefusedError
from impactcell.web.sessions import BrowserSession


@dataclass(frozen=True, slots=True)
class CellSystem:
    """What lies under one cell."""

    facts: CellFacts
    status: ModuleStatus
    freshness: Freshness
    journal_bytes: int
    journal_fault: Alarm | None

    @property
    def is_starting(self) -> bool:
        """Whether its module was not asked yet: no link is lost."""
        return self.freshness in (Freshness.STARTING, Freshness.COMPILING)


@dataclass(frozen=True, slots=True)
class RefusedCertificate:
    """A certificate that somebody tried to connect with."""

    subject: str
    thumbprint: str
    valid_until: str


@dataclass(frozen=True, slots=True)
class ExposedFile:
    """A file that grants access, and what others than its owner can do with it: `read`, `write`."""

    what: str
    path: Path
    can: tuple[str, ...]

    @property
    def way_out(self) -> str:
        """Command that closes it."""
        return f"chmod 600 {shlex.quote(str(self.path))}"


async def system(context: PageContext, request: Request, session: BrowserSession) -> Response:
    """Show the system; users, certificates and files that are open to others only to engineers."""
    views = context.feed.views
    sizes = await context.past.run(lambda: [_size(facts.journal) for facts in context.content.cells])
    cells = [
        _cell_system(facts, views[facts.name], size)
        for facts, size in zip(context.content.cells, sizes, strict=True)
    ]
    users: list[User] = []
    certificates: list[RefusedCertificate] = []
    exposed: list[ExposedFile] = []
    if session.actor.role >= Role.ENGINEER:
        users = await context.past.run(lambda: _users(context.settings.users))
        certificates = await context.past.run(lambda: refused_certificates(context.settings.certificates))
        exposed = await context.past.run(lambda: _exposed_files(context.content.cells))
    return context.page(
        request,
        "system.html.j2",
        session,
        systems=cells,
        users=users,
        certificates=certificates,
        exposed=exposed,
        viewers=context.feed.viewers,
        now_ns=context.now_ms() * 1_000_000,
    )


async def trust(context: PageContext, _: Request, session: BrowserSession, form: dict[str, str]) -> Response:
    """Trust a certificate that was refused."""
    try:
        await context.backend.trust_certificate(form.get("thumbprint", ""), session.actor)
    except RefusedError as error:
        raise RequestRefusedError(404, "error_not_found") from error
    return RedirectResponse("/system", 303)


def refused_certificates(pki: Path) -> list[RefusedCertificate]:
    """List the certificates in `rejected`."""
    listed = []
    for path in sorted((pki / "rejected").glob("*")):
        try:
            certificate = read_certificate(path)
        except AccessError:
            continue
        listed.append(_refused(certificate))
    return listed


def _refused(certificate: Certificate) -> RefusedCertificate:
    return RefusedCertificate(
        certificate.subject.rfc4514_string(),
        thumbprint(der(certificate)),
        f"{certificate.not_valid_after_utc:%Y-%m-%d}",
    )


def _exposed_files(cells: Sequence[CellFacts]) -> list[ExposedFile]:
    """List the files that grant access and are open to others, as they are now; cells may share them."""
    files = dict.fromkeys(file for facts in cells for file in facts.access_files)
    return [ExposedFile(what, path, can) for what, path in files if (can := what_others_can(path))]


def _users(path: Path) -> list[User]:
    try:
        return list(read_users(path).values())
    except AccessError:
        return []


def _cell_system(facts: CellFacts, view: CellView, size: int) -> CellSystem:
    fault = view.conditions.get(journal_fault.NAME)
    shown_fault = fault if fault is not None and fault.active else None
    return CellSystem(facts, view.status, view.freshness, size, shown_fault)


def _size(journal: Path | None) -> int:
    """Give the size of a journal with its log, in bytes; 0 where there is none."""
    if journal is None:
        return 0
    files = (journal, journal.with_name(journal.name + "-wal"))
    return sum(path.stat().st_size for path in files if path.exists())
