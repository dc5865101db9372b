"""The demo's whole loop: the gap alarm rises, the workflow names the effect, the model goes into service."""

import asyncio
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from impactcell.alarms.rules import model_gap
from impactcell.demo.scenario_setup import TOUR_OVER
from impactcell.physics.effect_names import in_words
from impactcell.records import Snapshot
from impactcell.settings import CellConfig

SHOTS = 60
"""Cycles with the effect that the workflow is given."""
MARGIN = 5
"""The estimated cycle of the change may be early by a few; cycles without the effect must not get in."""

Say = Callable[[str], None]


class AutoTeach:
    """Watches the gap alarm of a cell; once it has enough cycles since the change, it looks for the cause.

    Parameters
    ----------
    cell : CellConfig
        With a journal; its model file is replaced when an effect was named.
    say : callable
        Told in words what is being done and found.
    """

    def __init__(self, cell: CellConfig, say: Say) -> None:
        self._cell = cell
        self._say = say
        self._since: int | None = None
        self._task: asyncio.Task[None] | None = None
        self._accepted = False

    def take(self, snapshot: Snapshot) -> None:
        """Look at a cycle."""
        gap = next(alarm for alarm in snapshot.alarms if alarm.name == model_gap.NAME)
        if self._accepted:
            if not gap.active:
                self._say(f"the gap alarm has cleared, the extended model explains the captures; {TOUR_OVER}")
            return
        if gap.active and self._since is None:
            self._since = gap.evidence.change_cycle
            self._say(
                f"the model misses something since cycle {self._since}; collecting {SHOTS} cycles of it"
            )
        if self._since is not None and self._task is None and snapshot.cycle >= self._since + MARGIN + SHOTS:
            self._task = asyncio.create_task(self._find(self._since + MARGIN, snapshot.cycle), name="remedy")

    async def close(self) -> None:
        """End what is still going on."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _find(self, first: int, last: int) -> None:
        journal, path = self._cell.settings.journal, self._cell.path
        assert journal is not None  # noqa: S101 - the demo's cells have one
        with tempfile.TemporaryDirectory(prefix="impactcell-remedy-") as temporary:
            shots, results = Path(temporary) / "shots", Path(temporary) / "found"
            self._say(f"impactcell discrepancy on cycles {first} to {last} ...")
            between = ["--first-cycle", str(first), "--last-cycle", str(last)]
            await self._run("export", str(journal.file), "-o", str(shots), *between)
            await self._run("discrepancy", str(shots), "--cell", str(path), "-o", str(results))
            result = json.loads((results / "result.json").read_text(encoding="utf-8"))
            named = ", ".join(in_words(effect["effect"]) for effect in result["effects"]) or "nothing"
            held_out = result["gap"]["held_out"]
            gaps = f"held-out gap {held_out['before']} before, {held_out['after']} after"
            verdict = f"{result['verdict']}: {named}; {gaps}"
            self._say(verdict)
            if result["effects"]:
                await self._run("model", "accept", str(path), str(results / result["model"]))
                self._accepted = True
                self._say(f"{verdict}; the extended model is in service")

    async def _run(self, *arguments: str) -> None:
        """Run a verb in a process of its own, so that the cell goes on undisturbed."""
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "impactcell",
            *arguments,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            _, errors = await process.communicate()
        except asyncio.CancelledError:
            process.terminate()
            await process.wait()
            raise
        if process.returncode:
            self._say(f"impactcell {arguments[0]} failed: {errors.decode().strip()[-200:]}")
            raise asyncio.CancelledError
