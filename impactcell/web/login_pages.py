"""Logging in and out."""

import logging

from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from impactcell.scada import RefusedError
from impactcell.web.page_context import PageContext
from impactcell.web.requests import address_of, cookie_name, local_path, session_of
from impactcell.web.sessions import BrowserSession

_log = logging.getLogger(__name__)


async def login(context: PageContext, request: Request) -> Response:
    """Ask for name and password."""
    after = local_path(request.query_params.get("next", "/"))
    if session_of(request, context.sessions) is not None:
        return RedirectResponse(after, 303)
    is_over = "over" in request.query_params
    return context.page(request, "login.html.j2", None, after=after, user="", is_wrong=False, is_over=is_over)


async def log_in(context: PageContext, request: Request, form: dict[str, str]) -> Response:
    """Begin a session for the right password."""
    user, after = form.get("user", ""), local_path(form.get("next", "/"))
    try:
        actor = await context.backend.log_in(user, form.get("password", ""), address_of(request))
    except RefusedError:
        return context.page(
            request, "login.html.j2", None, status=401, after=after, user=user, is_wrong=True, is_over=False
        )
    session = context.sessions.begin(actor)
    _log.info("%s (%s) logged in to the page from %s", actor.user, actor.role.name.lower(), actor.address)
    response = RedirectResponse(after, 303)
    response.set_cookie(
        cookie_name(request),
        session.token,
        httponly=True,
        samesite="strict",
        secure=context.settings.is_encrypted,
    )
    return response


async def log_out(
    context: PageContext, request: Request, session: BrowserSession, _: dict[str, str]
) -> Response:
    """End the session."""
    context.sessions.end(session)
    response = RedirectResponse("/login", 303)
    response.delete_cookie(cookie_name(request))
    return response
