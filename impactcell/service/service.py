"""The whole process: every cell a task, cells of one endpoint on one OPC UA server, signals, readiness."""

import asyncio
import contextlib
import gc
import logging
import signal
import sys
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from functools import partial

from impactcell import cell as core
from impactcell.alarms.rules import journal_fault
from impactcell.errors import ForeignJournalError, JournalError, UnstoredError
from impactcell.fieldbus.transports import Transports
from impactcell.numerics.compilation import COMPILING, on_compilation
from impactcell.opcua.sessions.large_requests import leave_full_rounds_to_the_server
from impactcell.process import log_lines, systemd
from impactcell.process.cell_logger import CellLogger
from impactcell.process.signals import stop_on_signals
from impactcell.process.stopping import STOPPED_EARLY, in_passing_thread, unless_stopped, whole
from impactcell.scada import Server
from impactcell.service.cell_task import CellTask, SnapshotCallback
from impactcell.service.factory import (
    cell_description,
    cell_design,
    server_settings,
)
from impactcell.service.history_source import JournalHistory
from impactcell.service.monitoring import CellHealth, Monitoring, waiting_cell
from impactcell.service.operator_commands import OperatorCommands
from impactcell.service.page_servers import served_pages
from impactcell.service.warmup import load_planners
from impactcell.settings import CellConfig
from impactcell.settings.exposed_files import exposed_files
from impactcell.web import CellNews, TourStop
from impactcell.web.live_feed import LiveFeed

log = logging.getLogger("impactcell.service")

SWITCH_S = 0.001
"""How long a cell's thread may keep the interpreter while the event loop waits for it, which it does some
twenty times a capture: Python's own 5 ms would be felt."""
RESTART_S = 1.0
"""A cell that met a fault of ours is begun anew after this long."""
AGAIN_S, AGAIN_AT_MOST_S = 1.0, 30.0
"""A journal that cannot be opened is tried again after the first, each time after twice as long, and at last
every so often as the second says."""


class Service:
    """Runs cells until told to stop.

    Parameters
    ----------
    cells : sequence of CellConfig
    on_snapshot : callable, optional
        Called with the cell's name and each snapshot, after it was published.
    tours : mapping, optional
        What the page tells of each cell that is a demo.

    A cell whose journal cannot be opened is told and waits, without values, until it can; the others run.

    Raises
    ------
    JournalError
        No journal can be opened, and trying again cannot help; nothing has been started. Where none is theirs
        to open, a ForeignJournalError.
    """

    def __init__(
        self,
        cells: Sequence[CellConfig],
        on_snapshot: SnapshotCallback | None = None,
        tours: Mapping[str, Sequence[TourStop]] | None = None,
    ) -> None:
        self._cells = tuple(cells)
        self._tours = tours or {}
        self._on_snapshot = on_snapshot
        self.running: dict[str, CellTask] = {}
        self.endpoints: dict[str, str] = {}
        """Where each cell is to be found, once `run` has started."""
        self.pages: dict[str, str] = {}
        """Address of the page that each cell is on, if any, once `run` has started."""
        self._feeds: dict[str, LiveFeed] = {}
        self._has_started = asyncio.Event()
        shared = Transports(cell.settings.module.link for cell in cells)
        self._transports = {cell.name: shared.transport_for(cell.settings.module.link) for cell in cells}

    async def run(self, stop: asyncio.Event, started: Callable[[], None] | None = None) -> None:
        """Run until `stop` is set; `started` is called when every endpoint listens.

        Raises
        ------
        UnstoredError
            Journals could not take all at the end.
        """
        tasks: list[asyncio.Task[None]] = []
        async with contextlib.AsyncExitStack() as stack:
            try:
                if await unless_stopped(self._start(stack, tasks), stop):
                    self._has_started.set()
                    if started is not None:
                        started()
                    await stop.wait()
                else:
                    log.info(STOPPED_EARLY)
            finally:
                systemd.notify("STOPPING=1")
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
                lost = await asyncio.gather(*(running.close() for running in self.running.values()))
        if sum(lost):
            raise UnstoredError(f"entries that no journal could take: {sum(lost)}; the log says why")

    async def _start(self, stack: contextlib.AsyncExitStack, tasks: list[asyncio.Task[None]]) -> None:
        """Make the cells, and all that shows them, to be left by `stack`; and begin `tasks`."""
        await in_passing_thread(partial(load_planners, self._cells))
        await self._make_cells()
        await stack.enter_async_context(self._monitoring())
        history = JournalHistory(self.running)
        stack.push_async_callback(history.close)
        servers = {}
        for endpoint in dict.fromkeys(cell.settings.opcua.endpoint for cell in self._cells):
            server, cell = self._server(endpoint, history)
            with cell.told_at("opcua.endpoint"):
                servers[endpoint] = await stack.enter_async_context(server)
        shown_by = {cell.name: servers[cell.settings.opcua.endpoint] for cell in self._cells}
        self.endpoints |= {name: server.endpoint for name, server in shown_by.items()}
        pages = await whole(
            stack.enter_async_context(
                served_pages(self._cells, shown_by, OperatorCommands(self.running), self._tours)
            )
        )
        self.pages |= {name: page.endpoint for name, page in pages.items()}
        self._feeds |= {name: page.feed for name, page in pages.items()}
        tasks += [
            asyncio.create_task(self._keep_running(cell, shown_by[cell.name]), name=cell.name)
            for cell in self._cells
        ]
        tasks.append(asyncio.create_task(systemd.keep_watchdog_quiet(), name="watchdog"))
        systemd.notify("READY=1")

    async def _make_cells(self) -> None:
        """Make every cell that can run."""
        faults: dict[str, JournalError] = {}
        for cell in self._cells:
            try:
                await whole(self._make(cell))
            except JournalError as error:
                faults[cell.fault(f"journal.file: {error}", "journal.file")] = error
        if faults and not self.running and not any(fault.retry for fault in faults.values()):
            is_foreign = all(isinstance(fault, ForeignJournalError) for fault in faults.values())
            raise (ForeignJournalError if is_foreign else JournalError)("\n".join(faults))

    async def _make(self, cell: CellConfig) -> None:
        """Make a cell, in a thread: a disk may take its time, and the others go on."""
        self.running[cell.name] = await asyncio.to_thread(
            CellTask, cell, self._on_snapshot, self._transports[cell.name]
        )

    def _health(self) -> list[CellHealth]:
        cells = [(cell.name, self.running.get(cell.name)) for cell in self._cells]
        return [waiting_cell(name) if running is None else running.health for name, running in cells]

    async def reload(self) -> None:
        """Read every cell's files again, once all have started; see `CellTask.reload`."""
        await self._has_started.wait()
        systemd.notify(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
        for running in tuple(self.running.values()):
            await running.reload()
        systemd.notify("READY=1")

    def _server(self, endpoint: str, history: JournalHistory) -> tuple[Server, CellConfig]:
        """Make a server, and give the cell whose file tells of it."""
        cells = [cell for cell in self._cells if cell.settings.opcua.endpoint == endpoint]
        server = Server(
            server_settings(cells[0]),
            cells[0].settings.opcua.users_file,
            [cell_description(cell) for cell in cells],
            history,
            OperatorCommands(self.running),
        )
        return server, cells[0]

    @contextlib.asynccontextmanager
    async def _monitoring(self) -> AsyncIterator[None]:
        cells = {cell.settings.monitoring: cell for cell in reversed(self._cells)}
        with contextlib.ExitStack() as stack:
            for section, cell in cells.items():
                if section is None:
                    continue
                with cell.told_at("monitoring.port"):
                    http = stack.enter_context(Monitoring(section.host, section.port, self._health))
                log.info("health and metrics at http://%s:%d", http.host, http.port)
            yield

    async def _keep_running(self, cell: CellConfig, server: Server) -> None:
        """Begin a cell anew after a fault of ours, so that it stops neither itself nor the others."""
        logger = CellLogger(log, cell.name)
        while True:
            try:
                if cell.name not in self.running:
                    await self._open(cell, server)
                    logger.info("its journal can be opened now; the cell runs")
                await self.running[cell.name].run(server, self._feeds.get(cell.name))
            except asyncio.CancelledError:
                raise
            except Exception:
                logger.exception("a fault of this program; the cell is begun anew in %g s", RESTART_S)
                with contextlib.suppress(KeyError):
                    server.mark_bad(cell.name, time.time_ns())
                await asyncio.sleep(RESTART_S)

    async def _open(self, cell: CellConfig, server: Server) -> None:
        """Make a cell as soon as its journal can be opened; each reason why it cannot is told once."""
        reason, again_s = "", AGAIN_S
        while True:
            try:
                await whole(self._make(cell))
                return await self.running[cell.name].reload()  # its files may be others by now
            except JournalError as error:
                if str(error) != reason:
                    reason = str(error)
                    _tell_fault(cell, server, self._feeds.get(cell.name), reason)
            await asyncio.sleep(again_s)
            again_s = min(2.0 * again_s, AGAIN_AT_MOST_S)


def run(cells: Sequence[CellConfig]) -> None:
    """Run the service until SIGTERM or Ctrl-C; SIGHUP reloads.

    Raises
    ------
    SettingsError, JournalError
        The service cannot start.
    UnstoredError
        It ended, and not all could be stored.
    KeyboardInterrupt
        Ended by Ctrl-C, after a clean shutdown.
    """
    log_lines.configure()
    on_compilation(lambda: log.info(COMPILING))
    _warn_of_exposed_files(cells)
    sys.setswitchinterval(SWITCH_S)
    if asyncio.run(_until_signalled(Service(cells))):
        raise KeyboardInterrupt


def _warn_of_exposed_files(cells: Sequence[CellConfig]) -> None:
    """Log once of each file that grants access and is open to others; cells may share them."""
    told: set[str] = set()
    for cell in cells:
        for remark in exposed_files(cell.settings):
            if remark.message not in told:
                log.warning("%s", cell.fault(remark.message, ".".join(remark.place)))
                told.add(remark.message)


async def _until_signalled(service: Service) -> bool:
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    reloads: set[asyncio.Task[None]] = set()

    def reload() -> None:
        task = loop.create_task(service.reload())
        reloads.add(task)
        task.add_done_callback(reloads.discard)

    loop.add_signal_handler(signal.SIGHUP, reload)
    with stop_on_signals(stop) as received:
        await service.run(stop, lambda: _say_started(service))
    return signal.SIGINT in received


def _say_started(service: Service) -> None:
    gc.freeze()  # nodes and their types stay: to look through them for garbage held everything for 0.4 s
    leave_full_rounds_to_the_server()
    gc.enable()
    for cell, endpoint in service.endpoints.items():
        log.info("cell=%s at %s", cell, endpoint)


def _tell_fault(cell: CellConfig, server: Server, feed: LiveFeed | None, reason: str) -> None:
    """Log why a cell does not run, and raise its alarm; once it runs, it shows its own."""
    log.error("cell=%s waits until its journal can be opened: %s", cell.name, reason)
    design = cell_design(cell)
    fault = journal_fault.result(reason)
    for alarm in core.apply_rule_result(design, core.initial_state(design), fault, time.time_ns())[1]:
        server.alarm(cell.name, alarm)
        if feed is not None:
            feed.put(CellNews(cell.name, alarms=(alarm,)))
