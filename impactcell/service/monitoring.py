"""`/healthz` and Prometheus `/metrics` over HTTP for the cells of a process; off unless the YAML says so."""

import contextlib
import io
import json
import logging
import math
import socket
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from time import monotonic
from types import TracebackType
from typing import Any, Final, Self

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest
from prometheus_client.registry import Collector, CollectorRegistry

from impactcell.alarms import RULES
from impactcell.alarms.rules import journal_fault
from impactcell.errors import SettingsError

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class CellHealth:
    """What monitoring shows of one cell.

    Attributes
    ----------
    alarms : mapping
        Whether each is active, by its published name.
    link_fault, journal_fault : str
        Why the module does not answer, or the journal cannot be written; empty while all is well.
    """

    cell: str
    cycles: int
    missed: int
    last_cycle: int
    round_trip_s: float
    mu_s: float
    wear_level: float
    alarms: Mapping[str, bool]
    link_fault: str = ""
    journal_fault: str = ""

    @property
    def reason(self) -> str:
        """Why it is not healthy; empty where it is: the module answers and the journal can be written."""
        return "; ".join(fault for fault in (self.link_fault, self.journal_fault) if fault)


def waiting_cell(cell: str) -> CellHealth:
    """Health of a cell that waits until its journal can be opened; the alarm is the journal's."""
    return CellHealth(
        cell,
        cycles=0,
        missed=0,
        last_cycle=0,
        round_trip_s=math.nan,
        mu_s=math.nan,
        wear_level=math.nan,
        alarms={name: name == journal_fault.NAME for name in RULES},
        link_fault="not connected yet",
        journal_fault="the journal cannot be opened; the cell waits for it",
    )


Health = Callable[[], Iterable[CellHealth]]

PATIENCE_S = 5.0
"""How long a scraper may take to send its request, or to take the answer."""
MAX_SCRAPERS: Final = 32
"""Requests at a time, each in a thread; one more is closed before it is read."""

_METRICS: tuple[tuple[str, str, str, Callable[[CellHealth], float]], ...] = (
    ("gauge", "connected", "1 while the module answers", lambda h: float(not h.link_fault)),
    ("counter", "cycles", "Cycles processed since the start", lambda h: h.cycles),
    (
        "counter",
        "cycles_missed",
        "Cycles the module had overwritten, or the journal lost",
        lambda h: h.missed,
    ),
    ("gauge", "last_cycle", "Number of the last cycle", lambda h: h.last_cycle),
    ("gauge", "round_trip_seconds", "Of the last Modbus request", lambda h: h.round_trip_s),
    ("gauge", "static_friction", "mu_s of the last cycle", lambda h: h.mu_s),
    ("gauge", "wear_level", "Tracked mu_s at the reference batch", lambda h: h.wear_level),
    ("gauge", "journal_ok", "1 while the journal can be written", lambda h: float(not h.journal_fault)),
)
"""Kind, name, help and value of each metric; units are base units, as Prometheus asks for."""


class _Cells(Collector):
    def __init__(self, health: Health) -> None:
        self._health = health

    def collect(self) -> Iterable[Metric]:
        cells = list(self._health())
        for kind, name, text, value in _METRICS:
            family = (CounterMetricFamily if kind == "counter" else GaugeMetricFamily)(
                f"impactcell_{name}", text, labels=["cell"]
            )
            for cell in cells:
                family.add_metric([cell.cell], value(cell))
            yield family
        alarms = GaugeMetricFamily(
            "impactcell_alarm_active", "1 while the alarm is active", labels=["cell", "alarm"]
        )
        for cell in cells:
            for name, is_active in cell.alarms.items():
                alarms.add_metric([cell.cell, name], float(is_active))
        yield alarms


class _Request(io.RawIOBase):
    """What a scraper sends, all of it within `PATIENCE_S`."""

    def __init__(self, connection: socket.socket) -> None:
        super().__init__()
        self._connection = connection
        self._until_s = monotonic() + PATIENCE_S

    def readable(self) -> bool:
        """Whether it can be read."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Read what has come, or wait for it as long as there is time."""
        left_s = self._until_s - monotonic()
        if left_s <= 0.0:
            raise TimeoutError
        self._connection.settimeout(left_s)
        try:
            return self._connection.recv_into(buffer)
        finally:
            self._connection.settimeout(PATIENCE_S)  # for the answer


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, host: str, port: int, handler: type[BaseHTTPRequestHandler]) -> None:
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._places = threading.BoundedSemaphore(MAX_SCRAPERS)
        super().__init__((host, port), handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread, where one is free."""
        if not self._places.acquire(blocking=False):
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except RuntimeError:  # no thread can be started
            self._places.release()
            raise

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer one request."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._places.release()

    def handle_error(self, request: object, client_address: object) -> None:  # noqa: ARG002 - its signature
        """Stay silent where a scraper has gone; say what else went wrong."""
        error = sys.exception()
        if not isinstance(error, OSError):
            log.error("monitoring: a request from %s failed", client_address, exc_info=error)


class Monitoring:
    """An HTTP listener in a thread of its own, from entering the context to leaving it.

    Raises
    ------
    SettingsError
        On entering, if the address cannot be listened on.
    """

    def __init__(self, host: str, port: int, health: Health) -> None:
        self.host, self.port = host, port
        registry = CollectorRegistry()
        registry.register(_Cells(health))

        class Handler(BaseHTTPRequestHandler):
            def setup(self) -> None:
                super().setup()
                self.rfile = io.BufferedReader(_Request(self.connection))

            def do_GET(self) -> None:
                page = self.path.partition("?")[0].rstrip("/")
                if page == "/metrics":
                    self._answer(200, CONTENT_TYPE_LATEST, generate_latest(registry))
                elif page == "/healthz":
                    reasons = {cell.cell: cell.reason for cell in health()}
                    content = {
                        name: {"healthy": not reason, "reason": reason} for name, reason in reasons.items()
                    }
                    status = 503 if any(reasons.values()) else 200
                    self._answer(status, "application/json", json.dumps(content).encode())
                else:
                    self.send_error(404, "only /healthz and /metrics are here")

            def do_HEAD(self) -> None:
                self.do_GET()

            def _answer(self, status: int, content_type: str, body: bytes) -> None:
                self.send_response(status)
                self.send_header("Content-Type", content_type)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                if self.command != "HEAD":
                    self.wfile.write(body)

            def log_message(self, *_: object) -> None:
                """Stay silent: a scrape every few seconds is no news."""

        self._handler = Handler

    def __enter__(self) -> Self:
        try:
            self._server = _Server(self.host, self.port, self._handler)
        except OSError as error:
            host = f"[{self.host}]" if ":" in self.host else self.host
            raise SettingsError(
                f"monitoring: cannot listen on {host}:{self.port} ({error.strerror}); choose another "
                "`monitoring.host` or `monitoring.port`, or end what uses it"
            ) from error
        self.port = self._server.server_address[1]
        self._is_ending = False
        self._thread = threading.Thread(target=self._serve, name="monitoring", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_ending = True
        with contextlib.suppress(OSError):  # whoever connects wakes the thread
            socket.create_connection((self.host, self.port), PATIENCE_S).close()
        self._thread.join(PATIENCE_S)
        self._server.server_close()

    def _serve(self) -> None:
        """Wait for requests, however long nobody asks; the listener's own loop would look for its end."""
        while not self._is_ending:
            self._server.handle_request()
