"""A study: files that somebody dropped, what was read of them, what came out, and what was done with it."""

import contextlib
import enum
import secrets
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import msgspec

KEPT_STUDIES: Final = 100
"""Studies that are kept; of more, those that ended longest ago are removed."""
ID_BYTES: Final = 9
"""Random bytes of a study's id, 72 bits: nobody guesses an address."""
MAX_STEPS: Final = 200
"""Steps that are remembered."""
RESTARTED: Final = "the service was restarted meanwhile"


class Stage(enum.Enum):
    """How far a study is."""

    RECEIVING = "receiving"
    READING = "reading"
    CONFIRMING = "confirming"
    STUDYING = "studying"
    DONE = "done"
    FAILED = "failed"


ENDED: Final = (Stage.CONFIRMING, Stage.DONE, Stage.FAILED)
"""Stages in which nothing is being done."""


class Goal(enum.Enum):
    """What somebody wants to know."""

    ESTIMATE = "estimate"
    DISCREPANCY = "discrepancy"


class Acceptance(msgspec.Struct, frozen=True):
    """A model that went into service, or went out of it again."""

    action: str
    user: str
    time_ms: int
    model: str


class Study(msgspec.Struct):
    """One study, as it is stored in `study.json` of its directory.

    Attributes
    ----------
    cell : str
        Cell whose model the measurements are held against; empty for none.
    files : dict
        Names and sizes in bytes of what was received.
    choices : dict
        What somebody chose of columns and units, by the name of the form's field.
    overview : dict
        What was read: shots, channels, columns with their units.
    steps : list
        Names of the steps that were done, and when each began (ms).
    faults : list of str
        Why it failed, a line each; with row or line where a file is at fault.
    result : dict
        What came out: `result.json` of the workflow, or the shots' friction.
    changes : dict
        What accepting the model would change.
    refusals : list of str
        Why its model was not put into service, or out of it, when it was last asked for, a line each.
    """

    id: str
    title: str
    user: str
    created_ms: int
    cell: str = ""
    stage: Stage = Stage.RECEIVING
    goal: Goal = Goal.DISCREPANCY
    files: dict[str, int] = {}
    choices: dict[str, str] = {}
    overview: dict[str, Any] = {}
    steps: list[tuple[str, int]] = []
    faults: list[str] = []
    result: dict[str, Any] = {}
    changes: dict[str, Any] = {}
    accepting: str = ""
    acceptances: list[Acceptance] = []
    refusals: list[str] = []

    @property
    def is_working(self) -> bool:
        """Whether something is being done, or waits to be."""
        return self.stage not in (*ENDED, Stage.RECEIVING) or bool(self.accepting)

    @property
    def is_unreadable(self) -> bool:
        """Whether its files are not read yet, for want of something that is to be given."""
        return self.stage is Stage.CONFIRMING and bool(self.faults)

    @property
    def is_accepted(self) -> bool:
        """Whether its model was the last that it put into service."""
        return bool(self.acceptances) and self.acceptances[-1].action == "accept"

    @property
    def can_be_accepted(self) -> bool:
        """Whether a model for its cell came out of what was read last."""
        has_model = bool(self.cell and self.result.get("effects"))
        return has_model and self.stage is Stage.DONE and not self.is_working

    @property
    def can_be_restored(self) -> bool:
        """Whether its model can be taken out of service."""
        return bool(self.cell) and self.is_accepted and not self.is_working

    def begin_step(self, name: str) -> None:
        """Remember that a step has begun."""
        self.steps = [*self.steps, (name, time.time_ns() // 1_000_000)][-MAX_STEPS:]


class StudyStore:
    """The studies of a page, each in a directory of its own.

    Belongs to one thread.

    Parameters
    ----------
    directory : Path
        Made when the first study is.
    may_remove : callable
        Whether a study can go.
    """

    def __init__(self, directory: Path, may_remove: Callable[[Study], bool] = lambda _: True) -> None:
        self._directory = directory
        self._may_remove = may_remove
        self._studies = {study.id: study for study in _stored(directory)}
        for study in self._studies.values():
            if study.stage not in (Stage.DONE, Stage.FAILED):
                study.result, study.changes = {}, {}  # of a reading before, as earlier versions kept it
            if study.accepting:  # what came out stands as before
                study.accepting, study.refusals = "", [RESTARTED]
            elif study.is_working or study.stage is Stage.RECEIVING:
                study.stage, study.faults = Stage.FAILED, [RESTARTED]

    def __iter__(self) -> Iterator[Study]:
        """Give all, the newest first."""
        return iter(sorted(self._studies.values(), key=lambda study: -study.created_ms))

    def changed_since(self, study: Study) -> Study | None:
        """Find the study by which the model of its cell was changed last, if that was after its own last."""
        mine = max((done.time_ms for done in study.acceptances), default=None)
        if mine is None:
            return None
        later = (
            (done.time_ms, other.id, other)
            for other in self._studies.values()
            if other.cell == study.cell and other is not study
            for done in other.acceptances
            if done.time_ms > mine
        )
        return max(later, default=(0, "", None))[2]

    def is_in_service(self, study: Study) -> bool:
        """Whether its cell runs with its model, as far as studies have changed that."""
        return study.is_accepted and self.changed_since(study) is None

    def find(self, study_id: str) -> Study | None:
        """Find one; None where there is none."""
        return self._studies.get(study_id)

    def begin(self, title: str, user: str, cell: str) -> Study:
        """Make one.

        Raises
        ------
        OSError
            There is no room for it.
        """
        old = [study for study in self if self._may_remove(study) and study.stage in ENDED]
        for study in old[KEPT_STUDIES - 1 :]:
            self.remove(study)
        study = Study(secrets.token_urlsafe(ID_BYTES), title, user, time.time_ns() // 1_000_000, cell)
        self.files(study).mkdir(parents=True)
        self._studies[study.id] = study
        self.save(study)
        return study

    def save(self, study: Study) -> None:
        """Write down how far it is."""
        path = self.directory(study) / "study.json"
        with contextlib.suppress(OSError):  # a full disk must not end what is being done
            path.with_suffix(".part").write_bytes(msgspec.json.encode(study))
            path.with_suffix(".part").replace(path)

    def remove(self, study: Study) -> None:
        """Forget one, with all its files."""
        self._studies.pop(study.id, None)
        shutil.rmtree(self.directory(study), ignore_errors=True)

    def directory(self, study: Study) -> Path:
        """Where everything of a study lies."""
        return self._directory / study.id

    def files(self, study: Study) -> Path:
        """Where the files lie that were received."""
        return self.directory(study) / "files"

    def campaign(self, study: Study) -> Path:
        """Where the campaign lies that was made of them."""
        return self.directory(study) / "campaign"

    def results(self, study: Study) -> Path:
        """Where the results lie."""
        return self.directory(study) / "results"


def _stored(directory: Path) -> list[Study]:
    studies = []
    for path in directory.glob("*/study.json"):
        with contextlib.suppress(OSError, msgspec.MsgspecError):
            studies.append(msgspec.json.decode(path.read_bytes(), type=Study))
    return studies
