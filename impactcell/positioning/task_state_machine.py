"""One positioning task as a state machine: events in, what is to be done out; nothing is done here.

::

    IDLE ──begin──► COMMANDING ──commanded──► WAITING ──observed──► COMMANDING … ──► SETTLED
                        │                        │
                        └── abort ──► IDLE       ├── abort ──► IDLE
                        └── failed ─► FAULTED    └── failed, moved nothing, out of its band ──► FAULTED

A part that lies within the tolerance is in place however it got there; how it did is said with it.
`begin_task` may follow IDLE, SETTLED and FAULTED. Every transition is a pure function of task and event,
but for the planner, which learns from each observation.
"""

import contextlib
import enum
import math
from dataclasses import dataclass, replace

from impactcell.errors import PositioningError
from impactcell.positioning.planner import TapPlanner
from impactcell.positioning.safety_limits import SafetyLimits, check_tap
from impactcell.positioning.tap import Tap, Unreachable
from impactcell.records import LARGEST_STATISTIC, Evidence, PositioningState

BAND_SIGMAS = 3.29  # the band of a displacement holds 99.9 %
MOST_TAPS = 200  # of one task; a task that needs more is not converging
MOST_REPLANS = 20  # in a row; by chance 1 in 100 000 where readings scatter by a third of the tolerance


class TaskPhase(enum.Enum):
    """Where a task stands."""

    IDLE = "idle"
    COMMANDING = "commanding"
    WAITING = "waiting"
    SETTLED = "settled"
    FAULTED = "faulted"


@dataclass(frozen=True, slots=True)
class PositioningCell:
    """What the sequence has to know of the cell.

    Attributes
    ----------
    name : str
    limits : SafetyLimits
    resolution_m : float
        Of the encoder.
    two_sided : bool
        Actuators on both ends.
    """

    name: str
    limits: SafetyLimits
    resolution_m: float
    two_sided: bool = False


@dataclass(frozen=True, slots=True)
class TaskOutcome:
    """What became of a task; positions along +1, m. `settled`: the part is inside the tolerance."""

    target_m: float
    start_m: float
    position_m: float
    mass_kg: float
    taps: int
    settled: bool
    reason: str


@dataclass(frozen=True, slots=True)
class TaskState:
    """A task between two events.

    Attributes
    ----------
    start_m : float
        Where the part lay when the task began.
    tap : Tap or None
        To be commanded (COMMANDING), or commanded and not yet observed (WAITING).
    taps : int
        Commanded in this task.
    replans : int
        In a row, of a tap before which the part has moved.
    reason : str
        Why it is IDLE, SETTLED or FAULTED.
    evidence : Evidence or None
        Of the fault, for the alarm.
    """

    phase: TaskPhase = TaskPhase.IDLE
    target_m: float = math.nan
    position_m: float = math.nan
    mass_kg: float = math.nan
    tap: Tap | None = None
    taps: int = 0
    replans: int = 0
    reason: str = ""
    evidence: Evidence | None = None
    start_m: float = math.nan

    @property
    def remaining_m(self) -> float:
        """Target minus position."""
        return self.target_m - self.position_m

    @property
    def running(self) -> bool:
        """Whether a tap is to be commanded or awaited."""
        return self.phase in {TaskPhase.COMMANDING, TaskPhase.WAITING}

    @property
    def outcome(self) -> TaskOutcome:
        """What became of it, once it no longer runs."""
        settled = self.phase is TaskPhase.SETTLED
        return TaskOutcome(
            self.target_m, self.start_m, self.position_m, self.mass_kg, self.taps, settled, self.reason
        )

    def published(self) -> PositioningState:
        """Return the task as it is published."""
        tap = self.tap if self.running else None
        return PositioningState(
            target_m=self.target_m,
            remaining_m=self.remaining_m,
            next_velocity_m_s=math.nan if tap is None else tap.velocity_m_s,
            next_stroke_m=math.nan if tap is None else tap.stroke_m,
            running=self.running,
            taps=self.taps,
            reason=self.reason,
        )


def begin_task(
    sequence: TaskState,
    cell: PositioningCell,
    planner: TapPlanner,
    *,
    target_m: float,
    position_m: float,
    mass_kg: float,
    trained: bool,
) -> TaskState:
    """Start a task; SETTLED at once where the part is in place already.

    Parameters
    ----------
    target_m, position_m : float
        Along +1.
    mass_kg : float
        nan where it is not known.
    trained : bool
        Whether the friction estimator has a level to plan from.

    Raises
    ------
    PositioningError
        A task is running, the target lies behind the part or beyond its travel, the tolerance is finer than
        the encoder, position or mass are not known, the estimator is not trained, or no tap reaches the
        target. Nothing has been commanded.
    """
    name = cell.name
    if sequence.running:
        raise PositioningError(
            f"{name}: a task to {sequence.target_m * 1e3:.3f} mm is running; abort it first"
        )
    if not math.isfinite(target_m):
        raise PositioningError(f"{name}: the target must be a position in mm, not {target_m}")
    if not math.isfinite(position_m):
        raise PositioningError(f"{name}: the position of the part is not known")
    low, high = cell.limits.travel_m
    if not low <= target_m <= high:
        raise PositioningError(
            f"{name}: target {target_m * 1e3:.3f} mm is beyond the travel "
            f"of {low * 1e3:g} to {high * 1e3:g} mm"
        )
    if planner.tolerance_m < cell.resolution_m:
        raise PositioningError(
            f"{name}: a tolerance of {planner.tolerance_m * 1e6:g} µm is finer than the encoder's "
            f"{cell.resolution_m * 1e6:g} µm; raise positioning.tolerance_um"
        )
    if not cell.two_sided and target_m < position_m - planner.tolerance_m:
        raise PositioningError(
            f"{name}: target {target_m * 1e3:.3f} mm lies behind the part at {position_m * 1e3:.3f} mm, "
            "and this cell strikes from one side only"
        )
    if not (math.isfinite(mass_kg) and mass_kg > 0.0):
        raise PositioningError(
            f"{name}: the mass of the part is not known; state it in the cell file or register"
        )
    if not trained:
        raise PositioningError(f"{name}: friction is not known yet; let the estimator see some cycles first")
    fresh = TaskState(TaskPhase.IDLE, target_m, position_m, mass_kg, start_m=position_m)
    begun = _plan(fresh, cell, planner)
    if begun.phase is TaskPhase.FAULTED:
        raise PositioningError(begun.reason)
    return begun


def commanded(sequence: TaskState) -> TaskState:
    """Go on after the module has accepted the tap; its outcome is awaited."""
    if sequence.phase is not TaskPhase.COMMANDING:
        return sequence
    return replace(sequence, phase=TaskPhase.WAITING, taps=sequence.taps + 1)


def replan(sequence: TaskState, cell: PositioningCell, planner: TapPlanner, position_m: float) -> TaskState:
    """Plan the tap that has not been commanded anew: the part lies at `position_m` by now."""
    if sequence.phase is not TaskPhase.WAITING:
        return sequence
    number, times = sequence.taps, sequence.replans + 1
    lies = replace(sequence, position_m=position_m, tap=None, taps=number - 1, replans=times)
    if not math.isfinite(position_m):
        return failed(lies, f"{cell.name}: the position of the part is not known")
    if times > MOST_REPLANS:
        return failed(lies, f"{cell.name}: the part has moved {times} times before tap {number} was made")
    return _plan(lies, cell, planner)


def observed(sequence: TaskState, cell: PositioningCell, planner: TapPlanner, position_m: float) -> TaskState:
    """Go on after the tap has moved the part to `position_m`: next tap, SETTLED, or FAULTED with evidence."""
    tap = sequence.tap
    if sequence.phase is not TaskPhase.WAITING or tap is None:
        return sequence
    if not math.isfinite(position_m):
        return failed(sequence, f"{cell.name}: the module reported no position after tap {sequence.taps}")
    moved = (position_m - sequence.position_m) * tap.direction
    with contextlib.suppress(PositioningError):  # no tap moves a part so: `_miss` tells it
        planner.observe(tap, moved, sequence.mass_kg)
    lies = replace(sequence, position_m=position_m, tap=None, replans=0)
    half, off = 0.5 * (tap.highest_m - tap.lowest_m), moved - tap.expected_m
    missed = abs(off) / half * BAND_SIGMAS if half > 0.0 else math.inf
    evidence = Evidence(min(missed, LARGEST_STATISTIC), BAND_SIGMAS, size=off, size_std=half / BAND_SIGMAS)
    miss = _miss(sequence.taps, tap, moved, cell.resolution_m)
    if abs(lies.remaining_m) <= planner.tolerance_m:
        return replace(lies, phase=TaskPhase.SETTLED, reason=f"in place; {miss}" if miss else "in place")
    if miss:
        return failed(lies, f"{cell.name}: {miss}", evidence)
    if sequence.taps >= MOST_TAPS:
        return failed(lies, f"{cell.name}: not in place after {MOST_TAPS} taps")
    return _plan(lies, cell, planner)


def _miss(number: int, tap: Tap, moved_m: float, resolution_m: float) -> str:
    """Say how the outcome of a tap is not the one foretold; nothing where it is."""
    if moved_m < resolution_m:
        return f"tap {number} moved nothing"
    if tap.lowest_m - resolution_m <= moved_m <= tap.highest_m + resolution_m:
        return ""
    return (
        f"tap {number} moved the part by {moved_m * 1e3:.4f} mm, outside "
        f"the 99.9 % band of {tap.lowest_m * 1e3:.4f} to {tap.highest_m * 1e3:.4f} mm"
    )


def failed(sequence: TaskState, reason: str, evidence: Evidence | None = None) -> TaskState:
    """Stop with an alarm: link lost, command refused or not answered, or a tap that did not do its work."""
    if not sequence.running:
        return sequence
    return _stopped(sequence, TaskPhase.FAULTED, reason, evidence)


def aborted(sequence: TaskState, by: str) -> TaskState:
    """Stop because a person or the PLC says so; not a fault. An outstanding tap is to be cancelled."""
    if not sequence.running:
        return sequence
    return _stopped(sequence, TaskPhase.IDLE, f"aborted by {by}", None)


def _stopped(sequence: TaskState, phase: TaskPhase, reason: str, evidence: Evidence | None) -> TaskState:
    """End a task; where a tap that has been commanded and not observed leaves the part is not known."""
    is_outstanding = sequence.phase is TaskPhase.WAITING and sequence.tap is not None
    position_m = math.nan if is_outstanding else sequence.position_m
    return replace(sequence, phase=phase, tap=None, reason=reason, evidence=evidence, position_m=position_m)


def _plan(sequence: TaskState, cell: PositioningCell, planner: TapPlanner) -> TaskState:
    answer = planner.next_tap(sequence.remaining_m, sequence.mass_kg, sequence.position_m)
    if answer is None:
        return replace(sequence, phase=TaskPhase.SETTLED, tap=None, reason="in place")
    if isinstance(answer, Unreachable):
        return replace(
            sequence,
            phase=TaskPhase.FAULTED,
            tap=None,
            reason=f"{cell.name}: {answer.reason}",
            evidence=Evidence(),
        )
    force = planner.force(answer, sequence.mass_kg)
    try:
        tap = check_tap(answer, cell.limits, sequence.position_m, force, cell.name)
    except PositioningError as refused:
        return replace(sequence, phase=TaskPhase.FAULTED, tap=None, reason=str(refused), evidence=Evidence())
    return replace(sequence, phase=TaskPhase.COMMANDING, tap=tap)
