"""The page as a web application: which address leads where, and which role it takes."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from http import HTTPStatus
from typing import Final
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from impactcell.scada import Role
from impactcell.web import alarm_pages, cell_pages, login_pages, system_page
from impactcell.web.interface import PageBackend, PageContent, PageSettings
from impactcell.web.live_feed import LiveFeed
from impactcell.web.messages import Messages
from impactcell.web.page_context import STATIC, STATIC_VERSION, PageContext
from impactcell.web.past import Past
from impactcell.web.public_address import PublicAddress
from impactcell.web.requests import (
    CSRF_FIELD,
    RequestRefusedError,
    check_origin,
    check_token,
    cookie_name,
    read_form,
    session_of,
)
from impactcell.web.security_headers import SecurityHeaders
from impactcell.web.sessions import BrowserSession, SessionTable
from impactcell.web.studies import pages as study_pages
from impactcell.web.studies.queue import StudyQueue

Show = Callable[[PageContext, Request, BrowserSession], Awaitable[Response | ASGIApp]]
Act = Callable[[PageContext, Request, BrowserSession, dict[str, str]], Awaitable[Response]]


@dataclass(frozen=True, slots=True)
class View:
    """An address that shows something to whom has the role."""

    path: str
    show: Show
    role: Role = Role.OBSERVER
    is_page: bool = True
    """A page leads somebody who is not logged in to the login; what only scripts ask for says 401."""


@dataclass(frozen=True, slots=True)
class Action:
    """An address that a form is sent to by whom has the role."""

    path: str
    act: Act
    role: Role


VIEWS: Final = (
    View("/", cell_pages.overview),
    View("/cells/{cell}", cell_pages.cell),
    View("/cells/{cell}/trend", cell_pages.trend, is_page=False),
    View("/live", cell_pages.live, is_page=False),
    View("/live/alarms", cell_pages.live_alarms, is_page=False),
    View("/alarms", alarm_pages.alarms),
    View("/alarms/rows", alarm_pages.rows, is_page=False),
    View("/alarms/history.csv", alarm_pages.history_csv),
    View("/alarms/history.xlsx", alarm_pages.history_xlsx),
    View("/system", system_page.system),
    View("/studies", study_pages.studies),
    View("/studies/{study}", study_pages.study),
    View("/studies/{study}/state", study_pages.study_state, is_page=False),
    View("/studies/{study}/report", study_pages.report),
    View("/studies/{study}/files/{name}", study_pages.download),
)
"""Everything that can be looked at, but for the login and the static files, which are for all."""

ACTIONS: Final = (
    Action("/logout", login_pages.log_out, Role.OBSERVER),
    Action("/alarms/act", alarm_pages.act, Role.OPERATOR),
    Action("/cells/{cell}/reset-wear", cell_pages.reset_wear, Role.ENGINEER),
    Action("/system/trust", system_page.trust, Role.ENGINEER),
    Action("/studies", study_pages.begin, Role.OPERATOR),
    Action("/studies/{study}/read", study_pages.read, Role.OPERATOR),
    Action("/studies/{study}/run", study_pages.run, Role.OPERATOR),
    Action("/studies/{study}/accept", study_pages.accept, Role.ENGINEER),
    Action("/studies/{study}/restore", study_pages.restore, Role.ENGINEER),
    Action("/studies/{study}/remove", study_pages.remove, Role.OPERATOR),
)
"""Everything that can be done; each form needs the token of the session that it was shown to."""

UPLOADS: Final = (View("/studies/{study}/files", study_pages.upload, Role.OPERATOR, is_page=False),)
"""Where files are sent, with the token of the session in a header."""


def page_app(
    settings: PageSettings,
    content: PageContent,
    feed: LiveFeed,
    sessions: SessionTable,
    backend: PageBackend,
    studies: StudyQueue,
) -> ASGIApp:
    """Put the application together."""
    context = PageContext(settings, content, feed, sessions, backend, Past(), studies)
    routes = [
        Route("/login", _logged_out(context), methods=["GET", "POST"]),
        *(Route(view.path, _shown(context, view), methods=["GET"]) for view in VIEWS),
        *(Route(action.path, _done(context, action), methods=["POST"]) for action in ACTIONS),
        *(Route(upload.path, _received(context, upload), methods=["PUT"]) for upload in UPLOADS),
        Mount(f"/static/{STATIC_VERSION}", StaticFiles(directory=STATIC)),
    ]
    app = Starlette(
        routes=routes,
        exception_handlers={
            RequestRefusedError: _refused(context),
            ClientDisconnect: _left,
            404: _not_found(context),
            405: _not_found(context),
            Exception: _failed(context),
        },
    )
    served = app if settings.public_url is None else PublicAddress(app, settings.public_url)
    return SecurityHeaders(served)  # around all of it: what says that something failed has them too


def _logged_out(context: PageContext) -> Callable[[Request], Awaitable[Response]]:
    async def handle(request: Request) -> Response:
        if request.method == "POST":
            return await login_pages.log_in(context, request, await read_form(request))
        return await login_pages.login(context, request)

    return handle


def _shown(context: PageContext, view: View) -> Callable[[Request], Awaitable[Response]]:
    async def handle(request: Request) -> Response:
        session = session_of(request, context.sessions)
        if session is None:
            if not view.is_page:
                return JSONResponse({"error": "not logged in"}, 401)
            after = request.url.path + (f"?{request.url.query}" if request.url.query else "")
            was_logged_in = cookie_name(request) in request.cookies
            return RedirectResponse(f"/login?next={quote(after)}{'&over=1' if was_logged_in else ''}", 303)
        if session.actor.role < view.role:
            raise RequestRefusedError(403, "error_role")
        return await view.show(context, request, session)  # type: ignore[return-value] # a stream is no Response

    return handle


def _done(context: PageContext, action: Action) -> Callable[[Request], Awaitable[Response]]:
    async def handle(request: Request) -> Response:
        session = session_of(request, context.sessions)
        if session is None:
            return RedirectResponse("/login", 303)
        form = await read_form(request)
        check_token(session, form)
        if session.actor.role < action.role:
            raise RequestRefusedError(403, "error_role")
        return await action.act(context, request, session, form)

    return handle


def _received(context: PageContext, upload: View) -> Callable[[Request], Awaitable[Response]]:
    """Take a file; whatever is wrong is said in a sentence, since only scripts send files."""

    async def handle(request: Request) -> Response:
        try:
            session = _uploader(context, request, upload.role)
            return await upload.show(context, request, session)  # type: ignore[return-value] # no stream
        except RequestRefusedError as error:
            text = Messages(context.language(request))[error.reason]
            # What still comes of the file is not read: the connection ends with the answer.
            return JSONResponse({"error": text}, error.status, {"connection": "close"})

    return handle


def _uploader(context: PageContext, request: Request, role: Role) -> BrowserSession:
    session = session_of(request, context.sessions)
    if session is None:
        raise RequestRefusedError(401, "session_over")
    check_origin(request)
    check_token(session, {CSRF_FIELD: request.headers.get("x-csrf-token", "")})
    if session.actor.role < role:
        raise RequestRefusedError(403, "error_role")
    return session


def _refused(context: PageContext) -> Callable[[Request, Exception], Awaitable[Response]]:
    async def handle(request: Request, error: Exception) -> Response:
        assert isinstance(error, RequestRefusedError)  # noqa: S101 - it is registered for these
        response = context.error_page(request, error.status, error.reason)
        if error.status == HTTPStatus.REQUEST_TIMEOUT:  # what still comes is not waited for
            response.headers["connection"] = "close"
        return response

    return handle


async def _left(request: Request, error: Exception) -> Response:  # noqa: ARG001 - as Starlette calls it
    """Answer somebody who left in the middle of a request: nobody reads it, and it is no fault."""
    return Response(status_code=400)


def _not_found(context: PageContext) -> Callable[[Request, Exception], Awaitable[Response]]:
    async def handle(request: Request, error: Exception) -> Response:
        return context.error_page(request, getattr(error, "status_code", 404), "error_not_found")

    return handle


def _failed(context: PageContext) -> Callable[[Request, Exception], Awaitable[Response]]:
    """Say that a fault of the page is none of who asked; the server logs it with its traceback."""

    async def handle(request: Request, error: Exception) -> Response:  # noqa: ARG001 - as Starlette calls it
        return context.error_page(request, 500, "error_internal")

    return handle
