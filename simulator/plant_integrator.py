"""Joins the smooth phases of a shot at events that are located to rounding.

Each phase is integrated by DOP853 (Hairer, Nørsett, Wanner: Solving Ordinary Differential Equations I, II.5)
at a relative tolerance of 1e-10. A phase lasts while its guards hold; a guard that fails inside a step is
located on the step's own continuous output.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import brentq

from impactcell.errors import ImpactCellError
from simulator.plant_forces import Contact, Forces, Phase

RELATIVE_TOLERANCE = 1e-10
LOOKS_PER_STEP = 8
LENGTH_TOLERANCE = 1e-14
SPEED_TOLERANCE = 1e-12
FORCE_TOLERANCE = 1e-9
SETTLE_S = 0.25
HALVINGS = 40
LONGEST_CONTACT_STEP_S = 1e-3
LONGEST_SLIDE_STEP_S = 1e-2
FAR_AWAY_M = 1e9
MOST_EVENTS = 100_000

Guard = Callable[[float, Sequence[float]], float]


@dataclass(frozen=True, slots=True)
class Piece:
    """One step of the integrator, or the part of it before an event."""

    start_s: float
    stop_s: float
    phase: Phase
    states: Callable[[Any], NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class Event:
    """A change of phase: breakaway, stop, separation, contact or halt."""

    kind: str
    time_s: float


class NeverAtRestError(ImpactCellError):
    """The part was still moving when the time allowed had passed."""


@dataclass(frozen=True, slots=True)
class Path:
    """Everything the integrator found out about a shot."""

    pieces: tuple[Piece, ...]
    events: tuple[Event, ...]
    end_s: float
    end_state: tuple[float, ...]
    end_phase: Phase


def integrate(
    forces: Forces,
    phase: Phase,
    velocity: float,
    stroke: float,
    longest_s: float,
    *,
    halts_at_separation: bool = False,
    duration_s: float | None = None,
) -> Path:
    """Integrate until the part is at rest for good, or for `duration_s`.

    Raises
    ------
    NeverAtRestError
        The part still slides after `longest_s`.
    """
    run = _Run(
        forces,
        phase,
        velocity,
        stroke,
        halts_at_separation=halts_at_separation,
        ends_at_rest=duration_s is None,
    )
    limit = longest_s if duration_s is None else duration_s
    kinks = [time for time in forces.kinks() if 0.0 < time < limit]
    for time in [*kinks, limit]:
        while run.t < time:
            if duration_s is None and run.at_rest(laws_are_final=not kinks or run.t >= kinks[-1]):
                return run.path()
            run.advance(time)
    if duration_s is None and run.phase.slip:
        message = f"the part still slides after {longest_s:g} s"
        raise NeverAtRestError(message)
    return run.path()


class _Run:
    def __init__(
        self,
        forces: Forces,
        phase: Phase,
        velocity: float,
        stroke: float,
        *,
        halts_at_separation: bool,
        ends_at_rest: bool,
    ) -> None:
        self.forces = forces
        self.phase = phase
        self.t = 0.0
        self.z = forces.initial(velocity)
        if phase.contact is Contact.APART:
            self.z[2] = -FAR_AWAY_M
        self.ends_at_rest = ends_at_rest
        self.stroke = stroke
        self.halts_at_separation = halts_at_separation
        self.pieces: list[Piece] = []
        self.events: list[Event] = []
        self.still_since = 0.0

    def path(self) -> Path:
        return Path(tuple(self.pieces), tuple(self.events), self.t, tuple(self.z), self.phase)

    def at_rest(self, *, laws_are_final: bool) -> bool:
        phase = self.phase
        if (
            phase.slip
            or not phase.halted
            or not laws_are_final
            or self._failed(self._guards(), self.z) is not None
        ):
            return False
        if self.forces.presliding > 0.0:
            # Elastic stick has no damping of its own: without a force it rests, else it rings for ever.
            force = self.forces.contact(phase, self.t, self.z)[0] + self.forces.body(self.t, self.z)
            still = self.z[1] == 0.0 and abs(force) <= FORCE_TOLERANCE and self.z[0] == phase.anchor
            return still or self.t - self.still_since > SETTLE_S
        return not self.forces.ongoing or self.t - self.still_since > SETTLE_S

    def _guards(self) -> dict[str, tuple[Guard, float]]:
        """Return what has to stay above minus its tolerance for the phase to last."""
        forces, phase = self.forces, self.phase
        guards: dict[str, tuple[Guard, float]] = {}
        if phase.contact is Contact.TOUCHING:
            guards["separation"] = (lambda _, z: z[2] - z[0], LENGTH_TOLERANCE)
            way = 1.0 if phase.closing else -1.0
            guards["turn"] = (lambda t, z: way * forces.closing_rate(phase, t, z), SPEED_TOLERANCE)
        else:
            guards["contact"] = (lambda _, z: z[0] - z[2], LENGTH_TOLERANCE)
            if forces.pull_range > 0.0:
                side = 1.0 if phase.contact is Contact.NEAR else -1.0
                guards["range"] = (lambda _, z: side * (forces.pull_range - z[0] + z[2]), LENGTH_TOLERANCE)
        if not phase.halted:
            guards["halt"] = (lambda _, z: self.stroke - z[2], LENGTH_TOLERANCE)
        if phase.slip:
            guards["stop"] = (lambda _, z: phase.slip * z[1], SPEED_TOLERANCE)
        else:
            guards["breakaway"] = (
                lambda t, z: forces.static(t, z[0]) - abs(forces.applied(phase, t, z)),
                FORCE_TOLERANCE,
            )
        return guards

    def _failed(self, guards: dict[str, tuple[Guard, float]], z: Sequence[float]) -> str | None:
        for name, (guard, tolerance) in guards.items():
            if guard(self.t, z) < -tolerance:
                return name
        return None

    def advance(self, until: float) -> None:
        """One phase, or as much of it as lies before `until`."""
        phase, forces = self.phase, self.forces
        guards = self._guards()
        failed = self._failed(guards, self.z)
        if failed is not None:
            self._change(failed)
            return
        solver = DOP853(
            lambda t, z: np.array(forces.rates(phase, t, z.tolist())),
            self.t,
            np.array(self.z),
            until,
            rtol=RELATIVE_TOLERANCE,
            max_step=self._longest_step_s(),
            atol=np.array(forces.absolute_tolerance),  # type: ignore[arg-type]  # the stubs know scalars only
        )
        while solver.status == "running":
            problem = solver.step()
            if problem is not None:
                raise RuntimeError(problem)
            began, ended = float(solver.t_old), float(solver.t)
            dense = solver.dense_output()
            name, time = _first_failure(guards, dense, began, ended)
            self.pieces.append(Piece(began, time, phase, dense))
            if name is not None:
                self.t, self.z = time, dense(time).tolist()
                self._change(name)
                return
            self.t, self.z = ended, solver.y.tolist()
            if self.ends_at_rest and phase.halted and not phase.slip and ended - self.still_since > SETTLE_S:
                return

    def _longest_step_s(self) -> float:
        """Return how long a step may be, so that its continuous output is as exact as its end.

        In stick nothing moves that could limit a step, but a force that goes on by itself may break the part
        away and be small again within a long one.
        """
        if self.phase.slip == 0 and self.forces.presliding == 0.0 and not self.forces.ongoing:
            return float("inf")
        return LONGEST_CONTACT_STEP_S if self.phase.contact is Contact.TOUCHING else LONGEST_SLIDE_STEP_S

    def _change(self, name: str) -> None:
        if len(self.events) > MOST_EVENTS:
            message = f"more than {MOST_EVENTS} changes of phase before {self.t:g} s"
            raise NeverAtRestError(message)
        phase = self.phase = self.phase.copy()
        self.events.append(Event(name, self.t))
        match name:
            case "separation":
                phase.contact = Contact.NEAR if self.forces.pull_range > 0.0 else Contact.APART
                phase.halted = phase.halted or self.halts_at_separation
            case "contact":
                phase.contact = Contact.TOUCHING
                self._set_closing()
            case "range":
                phase.contact = Contact.APART if phase.contact is Contact.NEAR else Contact.NEAR
            case "turn":
                phase.closing = not phase.closing
            case "halt":
                phase.halted = True
                self._set_closing()
            case "stop":
                self._stop()
            case "breakaway":
                applied = self.forces.applied(phase, self.t, self.z)
                phase.slip = 1 if applied > 0.0 else -1
            case _:
                raise AssertionError(name)

    def _set_closing(self) -> None:
        self.phase.closing = True
        self.phase.closing = self.forces.closing_rate(self.phase, self.t, self.z) >= 0.0

    def _stop(self) -> None:
        phase = self.phase
        self.z[1] = 0.0
        phase.slip = 0
        phase.anchor = self.z[0]
        self.still_since = self.t
        # A part that turns round without a rest breaks away again at once: the guard of stick sees to it.


def _first_failure(
    guards: dict[str, tuple[Guard, float]], dense: Any, began: float, ended: float
) -> tuple[str | None, float]:
    """Earliest guard that fails in a step, and when; the end of the step if none does."""
    times = np.linspace(began, ended, LOOKS_PER_STEP + 1)[1:]
    looks = list(zip(times.tolist(), dense(times).T.tolist(), strict=True))
    first: tuple[str | None, float] = (None, ended)
    for name, (guard, tolerance) in guards.items():
        before = began
        for time, state in looks:
            if before >= first[1]:
                break
            if guard(time, state) < -tolerance:
                located = _locate(guard, dense, before, time)
                if located < first[1] or first[0] is None:
                    first = (name, located)
                break
            before = time
    return first


def _locate(guard: Guard, dense: Any, before: float, after: float) -> float:
    def value(time: float) -> float:
        return guard(time, dense(time).tolist())

    low = before
    if value(low) <= 0.0:
        # A phase often begins with its guard at zero and rising, as a gap that has just opened: the failure
        # is then a later one, which may lie well within the first look.
        span = after - before
        low = next(
            (t for t in (before + span * 0.5**j for j in range(1, HALVINGS)) if value(t) > 0.0), before
        )
        if low == before:
            return before
    return float(brentq(value, low, after, xtol=1e-16, rtol=1e-14))
