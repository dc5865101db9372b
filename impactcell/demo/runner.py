"""The demo from beginning to end: set up, show each cycle, sum up."""

import asyncio
import contextlib
import json
import logging
import math
import shutil
import signal
import sys
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from rich.console import Console, RenderableType
from rich.live import Live

from impactcell.demo.auto_teach import AutoTeach
from impactcell.demo.endings import end_once, ended_by_signals
from impactcell.demo.scenario_setup import USER, DemoSetup, set_up_scenario
from impactcell.demo.targets import number, targets_json, targets_table
from impactcell.demo.view import Scene, coefficient_text, render
from impactcell.errors import ImpactCellError
from impactcell.numerics.compilation import has_lacked_code
from impactcell.positioning.task_state_machine import TaskOutcome
from impactcell.process.console import is_quiet, print_note
from impactcell.process.signals import ends_of_terminal, stop_on_signals
from impactcell.records import ModuleStatus, Snapshot
from impactcell.service import Service

SHOWN_CYCLES = 400
"""Cycles that the view remembers: more than a wide terminal has columns."""
PATIENCE_S = 60.0
"""Without a cycle for so long, a demo that was asked for a number of cycles has failed, s ..."""
FIRST_PATIENCE_S = 300.0
"""... and without the first one, before which a new machine compiles, s. Without a number it waits."""
REDRAWN_S = 1.0
"""Between two looks at a view that waits for the first cycle, s."""
QUIET_S = 4.0
"""Without a cycle for so long, the last part lies where it stays: taps follow each other faster."""


def demo(*, cycles: int | None, scenario: str, as_json: bool) -> None:
    """Run the demo until Ctrl-C, for `cycles` cycles, or until its last part is in place.

    Parameters
    ----------
    cycles : int or None
        Cycles after which it ends; None for as many as come.
    scenario : str
        One of `SCENARIOS` in `impactcell.demo.scenario_setup`.
    as_json : bool
        Draw nothing, and print a summary at the end, see `_DemoRun.summary`.

    Raises
    ------
    SettingsError
        There is no such scenario.
    ImpactCellError
        The simulator did not start, or no cycle came.
    KeyboardInterrupt
        After the summary, where Ctrl-C ended it.
    """
    with ended_by_signals(), set_up_scenario(scenario, cycles) as setup:
        run = _DemoRun(setup, cycles)
        if as_json or is_quiet() or not sys.stdout.isatty():
            interrupted = asyncio.run(run.follow(_draw_nothing if as_json or is_quiet() else _print_line))
        else:
            interrupted = asyncio.run(_live(run))
        end_once()
    if as_json:
        print(json.dumps(run.summary()))  # noqa: T201 - the result of the verb
    elif not is_quiet() and (table := run.table()) is not None:
        Console().print(table)
    if interrupted:
        raise KeyboardInterrupt


@dataclass(slots=True)
class _DemoRun:
    """Runs the service on the cell that was set up, and keeps what it said."""

    setup: DemoSetup
    cycles: int | None
    snapshots: deque[Snapshot] = field(default_factory=lambda: deque(maxlen=SHOWN_CYCLES))
    seen: int = 0
    outcomes: tuple[TaskOutcome, ...] = ()
    raised: list[dict[str, Any]] = field(default_factory=list)
    began_s: float = field(default_factory=time.monotonic)
    service: Service | None = None
    endpoint: str = ""
    page: str = ""
    missed: int = 0
    messages: list[tuple[int, str]] = field(default_factory=list)

    async def follow(self, draw: Callable[["_DemoRun", Snapshot], None]) -> bool:
        """Run to the end; True if it was ended by Ctrl-C."""
        stop, news = asyncio.Event(), asyncio.Event()
        auto_teach = AutoTeach(self.setup.cell, self._note)

        def observe(_: str, snapshot: Snapshot) -> None:
            self._take(snapshot)
            auto_teach.take(snapshot)
            news.set()
            draw(self, snapshot)
            if self.cycles is not None and self.seen >= self.cycles:
                stop.set()

        self.service = Service([self.setup.cell], observe, {self.setup.cell.name: self.setup.stops})
        watch = asyncio.create_task(self._watch(news, stop))
        with stop_on_signals(stop, *ends_of_terminal()) as signals:
            try:
                await self.service.run(stop, self._started)
            finally:
                running = self.service.running.get(self.setup.cell.name)
                self.outcomes = () if running is None else running.task_outcomes
                await auto_teach.close()
                watch.cancel()  # where it found the module silent it has ended, and its error comes out here
                with contextlib.suppress(asyncio.CancelledError):
                    await watch
        return signal.SIGINT in signals

    def _note(self, text: str) -> None:
        if not self.messages or self.messages[-1][1] != text:
            self.messages.append((self.snapshots[-1].cycle if self.snapshots else 0, text))

    def _started(self) -> None:
        assert self.service is not None  # noqa: S101 - it calls us
        self.endpoint = self.service.endpoints[self.setup.cell.name]
        self.page = self.service.pages[self.setup.cell.name]
        if not is_quiet() and not sys.stdout.isatty():  # the live view shows it itself
            print_note(f"page at {self.page}: user {USER}, password {self.setup.password}")

    def _take(self, snapshot: Snapshot) -> None:
        assert self._status is not None  # noqa: S101 - its cell calls us
        self.missed = self._status.missed
        before = {alarm.name: alarm.active for alarm in self.snapshots[-1].alarms} if self.snapshots else {}
        self.raised += [
            {"alarm": alarm.name, "cycle": snapshot.cycle, "message": alarm.message}
            for alarm in snapshot.alarms
            if alarm.active and not before.get(alarm.name, False)
        ]
        self.snapshots.append(snapshot)
        self.seen += 1

    async def _watch(self, news: asyncio.Event, stop: asyncio.Event) -> None:
        while True:
            news.clear()
            last = bool(self.snapshots) and math.isclose(
                self.snapshots[-1].positioning.target_m, self.setup.last_target_m, rel_tol=1e-6
            )
            patience_s = PATIENCE_S if self.snapshots else FIRST_PATIENCE_S
            try:
                # Where no number of cycles was asked for, the module may be silent as long as it likes.
                async with asyncio.timeout(QUIET_S if last else None if self.cycles is None else patience_s):
                    await news.wait()
            except TimeoutError:
                stop.set()
                if last:
                    self._note("that was the last part")
                    return
                reason = "" if self._status is None else self._status.reason
                raise ImpactCellError(
                    f"no cycle for {patience_s:g} s: {reason or 'the module is silent'}"
                ) from None

    @property
    def _status(self) -> ModuleStatus | None:
        """State of the link; None while the cell does not run."""
        running = self.service.running.get(self.setup.cell.name) if self.service else None
        return None if running is None else running.status

    def scene(self) -> Scene:
        """Return what the live view shows now."""
        last = self.snapshots[-1].cycle if self.snapshots else 0
        told = [*self.setup.story, *self.messages, *self.setup.tour_end]
        messages = [text for cycle, text in sorted(told, key=lambda entry: entry[0]) if cycle <= last]
        who = f"user {USER}, password {self.setup.password}"
        link = "connected" if self._status is None or self._status.connected else "not connected"
        return Scene(
            self.setup.cell.name,
            f"{self.endpoint} · page: {self.page} · {who}",
            messages[-1] if messages else "",
            list(self.snapshots),
            link,
            time.monotonic() - self.began_s,
            compiles=has_lacked_code(),
        )

    def table(self) -> RenderableType | None:
        """Say what became of the parts; None in a scenario without targets."""
        positioning = self.setup.cell.settings.positioning
        if positioning is None:
            return None
        return targets_table(self.outcomes, positioning.tolerance_um * 1e-6)

    def _targets(self) -> dict[str, Any]:
        has_targets = self.setup.cell.settings.positioning is not None
        return {"targets": targets_json(self.outcomes)} if has_targets else {}

    def summary(self) -> dict[str, Any]:
        """One object that says how the demo went; null for what is not known.

        Without a cycle it ends at `missed`. `mu_s` to `batch` are of the last cycle, `alarms` those raised,
        `story` is what the scenario does at which cycle, and `told` what was done beside it.
        """
        if not self.snapshots:
            return {
                "cell": self.setup.cell.name,
                "endpoint": self.endpoint,
                "page": self.page,
                "cycles": 0,
                "missed": self.missed,
            }
        last = self.snapshots[-1]
        return {
            "cell": self.setup.cell.name,
            "endpoint": self.endpoint,
            "page": self.page,
            "cycles": self.seen,
            "missed": self.missed,
            "last_cycle": last.cycle,
            "mu_s": number(last.friction.mu_s.value),
            "mu_s_std": number(last.friction.mu_s.std),
            "mu_k": number(last.friction.mu_k.value),
            "estimator": last.friction.estimator.value,
            "quality": last.friction.mu_s.quality.name.lower(),
            "wear": {
                "level": number(last.wear.level),
                "level_std": number(last.wear.level_std),
                "level_common_std": number(last.wear.level_common_std),
                "rate_per_1000_cycles": number(last.wear.rate_per_cycle * 1000),
                "limit": number(last.wear.limit),
                "cycles_to_limit": number(last.wear.cycles_to_limit),
            },
            "batch": {
                "id": last.batch.batch_id,
                "offset": number(last.batch.offset),
                "last_shift": number(last.batch.last_shift),
                "last_shift_cycle": last.batch.last_shift_cycle,
            },
            **self._targets(),
            "alarms": self.raised,
            "story": [{"cycle": cycle, "what": text} for cycle, text in self.setup.story],
            "told": [{"cycle": cycle, "what": text} for cycle, text in self.messages],
        }


async def _live(run: _DemoRun) -> bool:
    console = Console()
    logging.disable(logging.WARNING)  # a line of the log would push the view up; it shows the same itself
    try:
        with Live(console=console, auto_refresh=False, screen=True) as live:

            def draw(now: _DemoRun, _: Snapshot | None = None) -> None:
                live.update(_rendered(now.scene()), refresh=True)

            async def draw_waiting() -> None:
                while not run.snapshots:
                    draw(run)
                    await asyncio.sleep(REDRAWN_S)

            waiting = asyncio.create_task(draw_waiting())
            try:
                interrupted = await run.follow(draw)
            finally:
                waiting.cancel()
    finally:
        logging.disable(logging.NOTSET)
    if run.snapshots:
        console.print(_rendered(replace(run.scene(), link="")))
    return interrupted


def _rendered(scene: Scene) -> RenderableType:
    columns, lines = shutil.get_terminal_size()
    return render(scene, min(columns, 160), lines)


def _print_line(_: _DemoRun, snapshot: Snapshot) -> None:
    active = (alarm.name for alarm in snapshot.alarms if alarm.active)
    batch = f"batch {snapshot.batch.batch_id or 'unnamed'}"
    facts = (f"mu_s {coefficient_text(snapshot.friction.mu_s)}", batch, *active)
    print(f"cycle {snapshot.cycle}: {', '.join(facts)}", flush=True)  # noqa: T201 - where there is no terminal


def _draw_nothing(_: _DemoRun, __: Snapshot) -> None:
    """Draw nothing: the summary, if anything, is all that is asked for."""
