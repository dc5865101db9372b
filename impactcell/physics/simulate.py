"""One tap, or one free slide, from first contact to rest."""

from functools import partial

import numpy as np

from impactcell.errors import NoStopError
from impactcell.physics import memory_layout as at
from impactcell.physics.integrator import integrate_all
from impactcell.physics.law_table import Program, assemble, columns, parameter_vector
from impactcell.physics.motion import Event, EventKind, Motion, Sampled
from impactcell.physics.plant import Plant, Strike
from impactcell.records import Samples

LONGEST_S = 600.0
ROOM = 4096
KINDS = (EventKind.BREAKAWAY, EventKind.CONTACT, EventKind.SEPARATION, EventKind.STOP, EventKind.HALT)
NONE = np.empty(0)
UNDRIVEN = np.zeros(2, dtype=np.int64)


def strike(plant: Plant, tap: Strike) -> Motion:
    """Integrate one tap by equations (1)-(3) and the plant's effects, from event to event.

    Parameters
    ----------
    plant : Plant
    tap : Strike

    Returns
    -------
    Motion

    Raises
    ------
    NoStopError
        The part never comes to rest: an actuator that never halts, or a slope it slides down.
    PhysicsError
        An effect or parameter that does not exist or is out of its range.
    """
    return _move(plant, tap, np.nan)


def slide(plant: Plant, tap: Strike, initial_speed_m_s: float) -> Motion:
    """Let a part slide freely from t = 0: no contact, `initial_speed_m_s` along the tap's direction.

    Velocity and stroke of `tap` mean nothing here. Raises as `strike` does.
    """
    return _move(plant, tap, initial_speed_m_s)


def _move(plant: Plant, tap: Strike, initial_speed_m_s: float) -> Motion:
    batches = tap.batch + 1
    program = assemble(tuple(plant.effects), batches)
    taps = columns([tap])
    taps["initial_speed_m_s"][0] = initial_speed_m_s
    rows = program.rows(parameter_vector(plant, program, batches)[None, :], plant.gravity_m_s2, taps)
    table = np.empty((1, at.FIGURES))
    kinds = np.empty(ROOM, dtype=np.int64)
    times = np.empty(ROOM)
    cursors = np.zeros((1, at.CURSORS), dtype=np.int64)
    cursors[0, at.ROOM] = ROOM
    laws = program.laws
    integrate_all(rows, laws, NONE, UNDRIVEN, LONGEST_S, at.TO_REST, cursors, NONE, NONE, kinds, times, table)
    figures = table[0]
    status = figures[at.STATUS]
    if status != at.AT_REST:
        raise NoStopError(
            "the part never came to rest: "
            + (
                "the actuator pushed it without end. Command a stroke"
                if status == at.TOO_MANY_EVENTS or np.isnan(figures[at.HALT_TIME])
                else f"it was still moving after {LONGEST_S:g} s, or ran away. Less tilt, or more friction"
            )
        )
    count = min(int(figures[at.EVENT_COUNT]), ROOM)
    stop = figures[at.STOP_TIME]
    return Motion(
        events=tuple(Event(KINDS[kinds[i]], float(times[i])) for i in range(count)),
        peak_force_n=float(figures[at.PEAK_FORCE]),
        displacement_m=float(figures[at.DISPLACEMENT]),
        stop_s=0.0 if np.isnan(stop) else float(stop),
        first_breakaway_s=float(figures[at.BREAKAWAY_TIME]),
        last_separation_s=float(figures[at.SEPARATION_TIME]),
        distance_after_separation_m=float(figures[at.DISTANCE]),
        course=partial(_sampled, rows, program),
    )


def _sampled(rows: Samples, program: Program, time_s: Samples) -> Sampled:
    """Integrate again, now with samples: it costs less than keeping every step would."""
    n = time_s.size
    order = np.argsort(time_s, kind="stable")
    cursors = np.array([[0, n, 2 * n, 3 * n, n, 2 * n, 3 * n, 4 * n, 0]], dtype=np.int64)
    out = np.empty(4 * n)
    integrate_all(
        rows,
        program.laws,
        NONE,
        UNDRIVEN,
        LONGEST_S,
        at.TO_LAST_SAMPLE,
        cursors,
        np.tile(time_s[order], 4),
        out,
        np.empty(0, dtype=np.int64),
        NONE,
        np.empty((1, at.FIGURES)),
    )
    channels = np.empty((4, n))
    channels[:, order] = out.reshape(4, n)
    return Sampled(*channels)
