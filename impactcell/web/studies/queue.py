"""One study at a time: what was dropped is read, studied and held against a cell, in processes of its own."""

import asyncio
import json
import logging
import re
import shutil
from collections import deque
from collections.abc import Awaitable, Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from impactcell.errors import CampaignError
from impactcell.measurements.notation.natural_order import natural_key
from impactcell.process.background import VerbOutcome, run_verb
from impactcell.web.studies.campaign_archive import holds_campaign, unpack_campaign
from impactcell.web.studies.overview import campaign_overview, friction_overview
from impactcell.web.studies.study import Goal, Stage, Study, StudyStore

MAX_WAITING: Final = 20
"""Studies that may wait; of more, somebody has to wait himself."""
READ_S: Final = 600.0
"""Longest time for reading what was dropped."""
STUDY_S: Final = 3600.0
"""Longest time of a study."""
MAX_FAULTS: Final = 40
"""Faults that are shown."""
PROGRAM_FAULT: Final = "a fault of this program; its log has it"
"""What is shown of a fault that nobody has foreseen."""
_CHOICE: Final = re.compile(r"(?:column|unit|set)\..+|trigger", re.DOTALL)
"""Names of the fields with which a form says how files are to be read."""

RunVerb = Callable[[Sequence[str], float, Callable[[str], None] | None], Awaitable[VerbOutcome]]

_log = logging.getLogger(__name__)


class StudyFailedError(Exception):
    """A study cannot go on; its text says why, a line each fault."""


class StudyQueue:
    """Works off studies, one at a time, in the order in which they were asked for.

    Belongs to the event loop of the page.

    Parameters
    ----------
    store : StudyStore
    cell_files : mapping
        Cell file of each cell that a study can be held against.
    run : callable, optional
        Runs a verb of this program.
    """

    def __init__(self, store: StudyStore, cell_files: Mapping[str, Path], run: RunVerb = run_verb) -> None:
        self.store = store
        self._cell_files = cell_files
        self._run = run
        self._waiting: deque[tuple[Study, Callable[[Study], Awaitable[None]]]] = deque()
        self._current: Study | None = None
        self._worker: asyncio.Task[None] | None = None

    @property
    def is_full(self) -> bool:
        """Whether nothing more can wait."""
        return len(self._waiting) >= MAX_WAITING

    def place(self, study: Study) -> int:
        """Say how many are before a study: 0 for one that is being worked on, or does not wait."""
        waiting = [waiting.id for waiting, _ in self._waiting]
        return waiting.index(study.id) + 1 if study.id in waiting else 0

    def read(self, study: Study) -> None:
        """Have the files read that were dropped."""
        self._enqueue(study, Stage.READING, self._read)

    def begin(self, study: Study, goal: Goal) -> None:
        """Have it studied, as what was read has been confirmed."""
        study.goal = goal
        self._enqueue(study, Stage.STUDYING, self._study)

    async def close(self) -> None:
        """End what is being done."""
        if self._worker is not None:
            self._worker.cancel()
            await asyncio.gather(self._worker, return_exceptions=True)

    def forget(self, study: Study) -> None:
        """Take a study out of the queue, and end what is being done of it."""
        self._waiting = deque(entry for entry in self._waiting if entry[0] is not study)
        if self._current is study and self._worker is not None:
            self._worker.cancel()
            self._worker = None
            self._begin_working()

    def _enqueue(self, study: Study, stage: Stage, work: Callable[[Study], Awaitable[None]]) -> None:
        study.stage, study.faults, study.refusals, study.steps = stage, [], [], []
        study.result, study.changes = {}, {}  # what came out before is of another reading or question
        shutil.rmtree(self.store.results(study), ignore_errors=True)
        self._waiting.append((study, work))
        self.store.save(study)
        self._begin_working()

    def _begin_working(self) -> None:
        if self._waiting and (self._worker is None or self._worker.done()):
            self._worker = asyncio.create_task(self._work(), name="studies")

    async def _work(self) -> None:
        while self._waiting:
            study, work = self._waiting.popleft()
            self._current = study
            try:
                await work(study)
            except (StudyFailedError, CampaignError) as error:
                study.stage, study.faults = Stage.FAILED, str(error).splitlines()[:MAX_FAULTS]
            except OSError as error:
                study.stage, study.faults = Stage.FAILED, [f"the disk: {error.strerror}"]
            except Exception:  # noqa: BLE001 - one study must not end those that wait
                _log.exception("study %s failed by a fault of this program", study.id)
                study.stage, study.faults = Stage.FAILED, [PROGRAM_FAULT]
            finally:
                if self._current is study:
                    self._current = None
            self.store.save(study)

    async def _read(self, study: Study) -> None:
        files, campaign = self.store.files(study), self.store.campaign(study)
        await asyncio.to_thread(shutil.rmtree, campaign, ignore_errors=True)
        names = sorted(study.files, key=natural_key)  # rows are the order in which shots were taken
        zips = [name for name in names if name.endswith(".zip")]
        if len(names) == 1 and zips and await asyncio.to_thread(holds_campaign, files / names[0]):
            study.begin_step("unpacking")
            await asyncio.to_thread(unpack_campaign, files / names[0], campaign)
            overview = {}
        else:
            overview = await self._import(study, [files / name for name in names])
        # In one go: the page is shown meanwhile, and asks for what belongs together.
        study.overview = overview | await asyncio.to_thread(campaign_overview, campaign)
        study.stage = Stage.CONFIRMING

    async def _import(self, study: Study, files: Sequence[Path]) -> dict[str, Any]:
        arguments = ["import", *map(str, files), "-o", str(self.store.campaign(study)), "--json"]
        outcome = await self._verb(study, [*arguments, *import_options(study.choices)], READ_S, may_fail=True)
        overview = _json(outcome.output)
        if not outcome.is_done:
            study.faults = _faults(study, self.store, outcome)
            if not overview:
                raise StudyFailedError("\n".join(study.faults))
        return overview

    async def _study(self, study: Study) -> None:
        results = self.store.results(study)
        results.mkdir(exist_ok=True)
        campaign = str(self.store.campaign(study))
        cell = self._cell_files.get(study.cell)
        against = [] if cell is None else ["--cell", str(cell)]
        if study.goal is Goal.ESTIMATE:
            table = results / "friction.csv"
            outcome = await self._verb(study, ["estimate", campaign, "-o", str(table), *against])
            overview = await asyncio.to_thread(friction_overview, table)
            study.result = overview | {"messages": list(outcome.messages)}
        else:
            told = f"--title={study.title}"
            arguments = ["discrepancy", campaign, "-o", str(results), "--json", told, *against]
            result = study.result = _json((await self._verb(study, arguments)).output)
            if cell is not None and result.get("effects"):  # what it found is shown meanwhile
                extended = str(results / result["model"])
                arguments = ["model", "accept", str(cell), extended, "--dry-run", "--json"]
                outcome = await self._verb(study, arguments, may_fail=True)
                study.changes = _json(outcome.output)  # what speaks against the model stands in it
                if not study.changes:
                    raise StudyFailedError("\n".join(_faults(study, self.store, outcome)))
        study.stage = Stage.DONE

    async def _verb(
        self, study: Study, arguments: Sequence[str], timeout_s: float = STUDY_S, *, may_fail: bool = False
    ) -> VerbOutcome:
        study.begin_step(" ".join(arguments[:2]) if arguments[0] == "model" else arguments[0])
        outcome = await self._run(arguments, timeout_s, study.begin_step)
        if outcome.exit_code is None:
            raise StudyFailedError(f"impactcell {arguments[0]} took longer than {timeout_s / 60:.0f} minutes")
        if not outcome.is_done and not may_fail:
            raise StudyFailedError("\n".join(_faults(study, self.store, outcome)))
        return outcome


def is_choice(field: str, value: str) -> bool:
    """Say whether a field of a form says how files are to be read: no other becomes an option.

    >>> is_choice("column.force", "F1"), is_choice("output", "/etc"), is_choice("column", "F1")
    (True, False, False)
    """
    return _CHOICE.fullmatch(field) is not None and "\0" not in field + value


def import_options(choices: Mapping[str, str]) -> list[str]:
    """Give the options of `impactcell import` for what was chosen on the form, one argument each.

    A field is named `column.QUANTITY`, `unit.COLUMN`, `set.NAME` or `trigger`; another is none of the form's.

    >>> import_options({"column.force": "F1", "unit.F1": "kN", "set.mass": "2 kg", "trigger": ""})
    ['--column=force=F1', '--unit=F1=kN', '--set=mass=2 kg']
    >>> import_options({"output": "/etc/campaign", "trigger": "--mapping=/etc/passwd"})
    ['--trigger=--mapping=/etc/passwd']
    """
    options = []
    for field, value in choices.items():
        if not is_choice(field, value):  # stored before such a form was refused
            continue
        option, _, name = field.partition(".")
        if value and name:
            options.append(f"--{option}={name}={value}")
        elif value:
            options.append(f"--{option}={value}")
    return options


def _faults(study: Study, store: StudyStore, outcome: VerbOutcome) -> list[str]:
    """Give what a verb said, with names of files as they were dropped."""
    prefixes = [f"{store.files(study)}/", f"{store.campaign(study)}/", f"{store.directory(study)}/"]
    lines = []
    for message in outcome.said or (f"ended with exit code {outcome.exit_code}",):
        text = message
        for prefix in prefixes:
            text = text.replace(prefix, "")
        lines.append(text)
    return lines[-MAX_FAULTS:]


def _json(output: str) -> dict[str, Any]:
    try:
        content = json.loads(output)
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}
