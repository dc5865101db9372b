"""The page's own thread: uvicorn on an event loop that nothing else uses."""

import asyncio
import contextlib
import logging
import socket
import ssl
import threading
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import uvicorn

from impactcell.errors import AccessError, SettingsError
from impactcell.opcua.certificates.certificate_dates import ANOTHER_FOR_THE_PAGE, CertificateWatch
from impactcell.opcua.certificates.certificate_files import read_certificate
from impactcell.process.tls_pair import pair_fault
from impactcell.scada.users import Users
from impactcell.web.app import page_app
from impactcell.web.connections import Connection
from impactcell.web.interface import CellFacts, PageBackend, PageContent, PageSettings
from impactcell.web.live_feed import LiveFeed
from impactcell.web.sessions import SessionTable
from impactcell.web.studies.queue import StudyQueue
from impactcell.web.studies.study import StudyStore

_log = logging.getLogger(__name__)

BACKLOG: Final = 128
"""Connections the system keeps waiting to be taken."""
KEEP_ALIVE_S: Final = 10
"""How long a connection without a request stays open."""
SHUTDOWN_S: Final = 1
"""How long requests may take to end when the service ends."""
DATE_S: Final = 1.0
"""How often the date of the answers is made anew: it has whole seconds."""


class _CutOff(logging.Filter):
    """Says in a line that the service's end cut a request off; uvicorn takes it for a fault of the page."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Let everything through, such a record without its traceback."""
        if record.exc_info and isinstance(record.exc_info[1], asyncio.CancelledError):
            record.msg, record.args, record.exc_info = "a request was cut off: the service ends", (), None
            record.levelno, record.levelname = logging.INFO, logging.getLevelName(logging.INFO)
        return True


class _Server(uvicorn.Server):
    """Told when to end, where uvicorn looks for it ten times a second."""

    def __init__(self, config: uvicorn.Config, watch: CertificateWatch | None) -> None:
        super().__init__(config)
        self._watch = watch
        self._ending = asyncio.Event()

    def end(self) -> None:
        """End what is served; from its event loop."""
        self.should_exit = True
        self._ending.set()

    async def main_loop(self) -> None:
        """Date the answers until the end, and tell where the certificate does not hold."""
        while not await self.on_tick(0):
            if self._watch is not None:
                self._watch.look(datetime.now(UTC))
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(DATE_S):
                    await self._ending.wait()


class PageServer:
    """Serves the page from a thread of its own, between `start` and `stop`.

    Parameters
    ----------
    settings : PageSettings
    cells : sequence of CellFacts
    backend : PageBackend
        Called from the page's thread; it sees to it that the service's own thread does the work.
    """

    def __init__(self, settings: PageSettings, cells: Sequence[CellFacts], backend: PageBackend) -> None:
        self._settings = settings
        self._content = PageContent(tuple(cells))
        self._backend = backend
        self.feed = LiveFeed(cell.name for cell in cells)
        """Where to put what happens; from any thread, at any time."""
        self._started = threading.Event()
        self.endpoint = settings.endpoint
        """Address of the page, with the port that was taken where the settings ask for a free one."""

    def start(self) -> None:
        """Listen, and serve from now on.

        Raises
        ------
        SettingsError
            The address cannot be listened on, or certificate and key do not fit.
        """
        certificate, key = self._settings.certificate, self._settings.key
        if certificate is not None and key is not None and (fault := pair_fault(certificate, key)):
            raise SettingsError(f"page: {fault}")
        url = urlsplit(self._settings.endpoint)
        try:
            listener = _listen(url.hostname or "127.0.0.1", url.port or 0)
        except OSError as error:
            raise SettingsError(
                f"page: cannot listen on {self._settings.endpoint} ({error.strerror}); "
                "choose another `web.endpoint`, or end what uses it"
            ) from error
        host = url.netloc.rpartition(":")[0]
        self.endpoint = url._replace(netloc=f"{host}:{listener.getsockname()[1]}").geturl()
        sessions = SessionTable(Users(self._settings.users))
        cell_files = {cell.name: cell.file for cell in self._content.cells if cell.file is not None}
        self._studies = StudyQueue(StudyStore(self._settings.studies), cell_files)
        app = page_app(self._settings, self._content, self.feed, sessions, self._backend, self._studies)
        config = uvicorn.Config(
            app,
            loop="asyncio",
            http=Connection,
            ws="none",
            lifespan="off",
            log_config=None,
            log_level="warning",
            access_log=False,
            server_header=False,
            proxy_headers=False,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=SHUTDOWN_S,
            ssl_certfile=certificate,
            ssl_keyfile=key,
        )
        try:
            config.load()
        except (OSError, ssl.SSLError) as error:
            listener.close()
            raise SettingsError(f"page: {certificate} and {key} cannot be used: {error}") from error
        self._server = _Server(config, None if certificate is None else _watch_of(certificate))
        self._listener = listener
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End every stream and stop listening; returns when it is done."""
        self._started.wait()
        with contextlib.suppress(RuntimeError):  # it has ended by itself
            self._loop.call_soon_threadsafe(self._end)
        self._thread.join()

    def _run(self) -> None:
        uvicorns, cut_off = logging.getLogger("uvicorn.error"), _CutOff()
        uvicorns.addFilter(cut_off)
        try:
            asyncio.run(self._serve())
        except (OSError, RuntimeError):
            _log.exception("the page has ended; cells and OPC UA go on")
        finally:
            uvicorns.removeFilter(cut_off)
            self._listener.close()

    async def _serve(self) -> None:
        self.feed.start()
        self._loop = asyncio.get_running_loop()
        self._started.set()
        try:
            await self._server.serve(sockets=[self._listener])
        finally:
            self.feed.close()
            await self._studies.close()

    def _end(self) -> None:
        """End the streams first: the server waits for them."""
        self.feed.close()
        self._server.end()


def _watch_of(certificate: Path) -> CertificateWatch | None:
    """Watch the page's certificate; None for one that TLS can use and nothing here can read."""
    try:
        return CertificateWatch(read_certificate(certificate), certificate, ANOTHER_FOR_THE_PAGE)
    except AccessError:
        return None


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.create_server((host, port), family=family, backlog=BACKLOG)
    listener.setblocking(False)  # noqa: FBT003 - its only argument
    return listener
