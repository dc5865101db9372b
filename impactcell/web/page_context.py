"""What every page is made with: the parts of the application, language, theme and templates."""

import asyncio
import hashlib
import time
from collections.abc import Coroutine
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from impactcell import __version__
from impactcell.physics.effect_names import as_title
from impactcell.records import Shelving
from impactcell.records.uncertainty import TOLD_STDS
from impactcell.scada import Role
from impactcell.web.interface import PageBackend, PageContent, PageSettings
from impactcell.web.live_feed import LiveFeed
from impactcell.web.messages import Messages, preferred_language
from impactcell.web.past import Past
from impactcell.web.requests import session_of
from impactcell.web.sessions import BrowserSession, SessionTable
from impactcell.web.studies.queue import StudyQueue
from impactcell.web.texts import LANGUAGES

STATIC: Final = Path(__file__).parent / "static"


def _static_version() -> str:
    files = sorted(path for path in STATIC.rglob("*") if path.is_file())
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:12]


STATIC_VERSION: Final = _static_version()
"""Part of the address of every static file: another content never has the same address."""
THEMES: Final = ("auto", "light", "dark")
"""Colours: as the system says, or as chosen."""
YEAR_S: Final = 365 * 86_400
"""How long a browser remembers language and theme."""


@cache
def _environment() -> Environment:
    """Give the templates, each compiled once in a process."""
    return Environment(
        loader=PackageLoader("impactcell.web"),
        autoescape=select_autoescape(default=True, default_for_string=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


@dataclass(frozen=True, slots=True)
class PageContext:
    """The parts of the application, for those who answer a request."""

    settings: PageSettings
    content: PageContent
    feed: LiveFeed
    sessions: SessionTable
    backend: PageBackend
    past: Past
    studies: StudyQueue
    receiving: dict[Path, int] = field(default_factory=dict)
    """Files that are being received, and the bytes that each takes."""
    _beside: set[asyncio.Task[None]] = field(default_factory=set)
    _templates: Environment = field(default_factory=_environment)

    def beside(self, work: Coroutine[Any, Any, None]) -> None:
        """Do something that no request waits for."""
        task = asyncio.get_running_loop().create_task(work)
        self._beside.add(task)
        task.add_done_callback(self._beside.discard)

    @staticmethod
    def now_ms() -> int:
        """Give the time of the day, milliseconds since 1970."""
        return time.time_ns() // 1_000_000

    @staticmethod
    def language(request: Request) -> str:
        """Choose the language of who asks."""
        return preferred_language(
            request.query_params.get("lang"),
            request.cookies.get("language"),
            request.headers.get("accept-language", ""),
        )

    def page(
        self,
        request: Request,
        template: str,
        session: BrowserSession | None,
        /,
        status: int = 200,
        **values: object,
    ) -> Response:
        """Render a page in the language and the colours of who asks for it."""
        asked, language = request.query_params.get("lang"), self.language(request)
        theme = request.cookies.get("theme", "auto")
        messages = Messages(language)
        html = self._templates.get_template(template).render(
            t=messages,
            language=language,
            languages=LANGUAGES,
            theme=theme if theme in THEMES else "auto",
            session=session,
            may_operate=session is not None and session.actor.role >= Role.OPERATOR,
            may_engineer=session is not None and session.actor.role >= Role.ENGINEER,
            path=request.url.path,
            version=__version__,
            told_stds=TOLD_STDS,
            as_title=as_title,
            static=f"/static/{STATIC_VERSION}",
            cells=self.content.cells,
            open_alarm_count=self._open_alarm_count() if session is not None else 0,
            **values,
        )
        response = HTMLResponse(html, status)
        if asked is not None and asked in LANGUAGES:
            response.set_cookie("language", asked, max_age=YEAR_S, samesite="strict", httponly=True)
        return response

    def _open_alarm_count(self) -> int:
        """Count what stands beside "Alarms" in the head, as the script of a live page does."""
        return sum(
            alarm.enabled
            and alarm.shelving is Shelving.UNSHELVED
            and (alarm.active or not alarm.acknowledged)
            for view in self.feed.views.values()
            for alarm in view.conditions.values()
        )

    def error_page(self, request: Request, status: int, reason: str) -> Response:
        """Say why a request is not carried out."""
        session = session_of(request, self.sessions)
        return self.page(request, "error.html.j2", session, status=status, code=status, reason=reason)
