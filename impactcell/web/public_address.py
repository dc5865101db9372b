"""The page behind a proxy: what is asked is asked at the address in the browser, which the settings name."""

from urllib.parse import urlsplit

from starlette.types import ASGIApp, Receive, Scope, Send


class PublicAddress:
    """Puts scheme and host of an address into every request.

    What a proxy says it has forwarded is not looked at: anybody can say that.

    Parameters
    ----------
    app : ASGIApp
    url : str
        The address, as browsers write it.
    """

    def __init__(self, app: ASGIApp, url: str) -> None:
        self._app = app
        parts = urlsplit(url)
        self._scheme, self._host = parts.scheme, (b"host", parts.netloc.encode())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request."""
        headers = [header for header in scope["headers"] if header[0] != b"host"]
        await self._app({**scope, "scheme": self._scheme, "headers": [self._host, *headers]}, receive, send)
