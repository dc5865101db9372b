"""One tap from first contact to rest, one free slide, or one part under a measured force."""

from functools import partial

import numpy as np

from impactcell.errors import NoStopError
from impactcell.physics import memory_layout as at
from impactcell.physics.ensemble import Ensemble
from impactcell.physics.integrator import integrate_all
from impactcell.physics.law_table import LawTable, build_law_table, parameter_vector, tap_columns
from impactcell.physics.motion import ChannelSamples, Motion, TapEvent, TapEventKind
from impactcell.physics.plant import Plant, TapInput
from impactcell.records import Samples

LONGEST_S = 600.0
ROOM = 4096
KINDS = (
    TapEventKind.BREAKAWAY,
    TapEventKind.CONTACT,
    TapEventKind.SEPARATION,
    TapEventKind.STOP,
    TapEventKind.HALT,
)
NONE = np.empty(0)
UNDRIVEN = np.zeros(2, dtype=np.int64)


def simulate_tap(plant: Plant, tap: TapInput) -> Motion:
    """Integrate one tap by equations (1)-(3) and the plant's effects, from event to event.

    Parameters
    ----------
    plant : Plant
    tap : TapInput

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
    return _simulate(plant, tap, np.nan)


def simulate_free_slide(plant: Plant, tap: TapInput, initial_speed_m_s: float) -> Motion:
    """Let a part slide freely from t = 0: no contact, `initial_speed_m_s` along the tap's direction.

    Velocity and stroke of `tap` mean nothing here. Raises as `simulate_tap` does.
    """
    return _simulate(plant, tap, initial_speed_m_s)


def simulate_driven(
    plant: Plant,
    tap: TapInput,
    time_s: Samples,
    force_n: Samples,
    sample_s: Samples,
    initial_speed_m_s: float = 0.0,
) -> ChannelSamples:
    """Let a measured force along +1 drive the part, which sticks and slips under it.

    Parameters
    ----------
    plant, tap
        Of the tap its mass, start and covariates; velocity, stroke and direction mean nothing here.
    time_s, force_n : ndarray, shape (n,)
        The force as measured, linear between its ascending times. Laws of the force sensor are undone to
        find the force that acts; where it saturates nothing can be undone.
    sample_s : ndarray, shape (m,)
        Ascending times at which to sample; the motion begins at `time_s[0]`.
    initial_speed_m_s : float
        Along +1.

    Returns
    -------
    Sampled
        `force_n` repeats the driving force; the actuator is nan.

    Raises
    ------
    PhysicsError
        For effects or parameters that do not exist, and times that do not ascend.
    """
    ensemble = Ensemble(
        [tap],
        tuple(plant.effects),
        position_time_s=[sample_s],
        velocity_time_s=[sample_s],
        gravity_m_s2=plant.gravity_m_s2,
        initial_speed_m_s=np.array([initial_speed_m_s]),
        drives=[(time_s, force_n)],
    )
    traces = ensemble.traces(ensemble.parameters(plant))
    return ChannelSamples(
        force_n=np.interp(sample_s, time_s, force_n),
        position_m=traces.position_m,
        actuator_m=np.full(len(sample_s), np.nan),
        velocity_m_s=traces.velocity_m_s,
    )


def _simulate(plant: Plant, tap: TapInput, initial_speed_m_s: float) -> Motion:
    batches = tap.batch + 1
    program = build_law_table(tuple(plant.effects), batches)
    taps = tap_columns([tap])
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
        events=tuple(TapEvent(KINDS[kinds[i]], float(times[i])) for i in range(count)),
        peak_force_n=float(figures[at.PEAK_FORCE]),
        displacement_m=float(figures[at.DISPLACEMENT]),
        stop_s=0.0 if np.isnan(stop) else float(stop),
        first_breakaway_s=float(figures[at.BREAKAWAY_TIME]),
        last_separation_s=float(figures[at.SEPARATION_TIME]),
        distance_after_separation_m=float(figures[at.DISTANCE]),
        course=partial(_sampled, rows, program),
    )


def _sampled(rows: Samples, program: LawTable, time_s: Samples) -> ChannelSamples:
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
    return ChannelSamples(*channels)
