"""What comes from a browser, judged before anything is done with it: who, from where, how much."""

import asyncio
import secrets
from typing import Final
from urllib.parse import parse_qs, urlsplit

from starlette.requests import Request

from impactcell.web.sessions import BrowserSession, SessionTable

MAX_FORM_BYTES: Final = 16_384
"""Longest form: a comment, percent-encoded, with room to spare."""
FORM_S: Final = 10.0
"""How long a form may take to come, as long as the head before it: 13 kbit/s."""
MAX_FIELDS: Final = 64
"""Fields of a form."""
CSRF_FIELD: Final = "csrf"


class RequestRefusedError(Exception):
    """A request that is not carried out; `status` is the HTTP status, `reason` a key of the catalogue."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


def cookie_name(request: Request) -> str:
    """Name of the session's cookie: browsers share cookies between the ports of a host."""
    return f"impactcell_{request.url.port or (443 if request.url.scheme == 'https' else 80)}"


def session_of(request: Request, sessions: SessionTable) -> BrowserSession | None:
    """Find who asks; None for somebody who is not, or no longer, logged in."""
    token = request.cookies.get(cookie_name(request))
    return None if token is None else sessions.find(token)


def address_of(request: Request) -> str:
    """Address of the browser, or of the proxy before it."""
    return request.client.host if request.client is not None else "unknown"


def local_path(path: str) -> str:
    """Take a path to go to after the login only where it leads to this page."""
    parts = urlsplit(path)
    is_local = not parts.scheme and not parts.netloc and path.startswith("/") and not path.startswith("//")
    return path if is_local and "\\" not in path and path.isprintable() else "/"


def check_origin(request: Request) -> None:
    """See that a request was made by a page of ours.

    Raises
    ------
    RequestRefusedError
        It was made elsewhere.
    """
    origin = request.headers.get("origin")
    site = request.headers.get("sec-fetch-site", "same-origin")
    expected = f"{request.url.scheme}://{request.headers.get('host', '')}"
    if site not in ("same-origin", "none") or (origin is not None and origin != expected):
        raise RequestRefusedError(403, "error_foreign")


async def read_form(request: Request) -> dict[str, str]:
    """Read a form that a page of ours has sent.

    Raises
    ------
    RequestRefusedError
        It comes from elsewhere, is too long or too slow, or is no form.
    """
    check_origin(request)
    if not request.headers.get("content-type", "").startswith("application/x-www-form-urlencoded"):
        raise RequestRefusedError(415, "error_form")
    body = bytearray()
    try:
        async with asyncio.timeout(FORM_S):
            async for chunk in request.stream():
                body += chunk
                if len(body) > MAX_FORM_BYTES:
                    raise RequestRefusedError(413, "error_too_long")
    except TimeoutError as error:
        raise RequestRefusedError(408, "error_form_slow") from error
    try:
        fields = parse_qs(
            body.decode(), keep_blank_values=True, strict_parsing=bool(body), max_num_fields=MAX_FIELDS
        )
    except ValueError as error:
        raise RequestRefusedError(400, "error_form") from error
    return {name: values[-1] for name, values in fields.items()}


def check_token(session: BrowserSession, form: dict[str, str]) -> None:
    """See that a form was shown to this session.

    Raises
    ------
    RequestRefusedError
        It was not.
    """
    if not secrets.compare_digest(form.get(CSRF_FIELD, "").encode(), session.csrf.encode()):
        raise RequestRefusedError(403, "error_token")
