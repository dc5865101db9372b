"""One tap from first contact to rest, one free slide, or one part under a measured force."""

from functools import partial

import numpy as np

from impactcell.errors import NoStopError
from impactcell.physics import memory_layout as at
from impactcell.physics.batch_integration import MAX_DURATION_S, NO_SAMPLES, sample_taps, undriven
from impactcell.physics.ensemble import Ensemble
from impactcell.physics.integrator import integrate_taps
from impactcell.physics.law_table import build_law_table, parameter_vector, tap_columns
from impactcell.physics.memory_layout import SampleArrays, TapArrays
from impactcell.physics.motion import ChannelSamples, Motion, TapEvent, TapEventKind
from impactcell.physics.plant import Plant, TapInput
from impactcell.records import Samples

MAX_EVENTS = 4096
"""Events of a tap that are kept: those of half a minute of stick and slip."""
EVENT_KINDS = (
    TapEventKind.BREAKAWAY,
    TapEventKind.CONTACT,
    TapEventKind.SEPARATION,
    TapEventKind.STOP,
    TapEventKind.HALT,
)
"""By their number in `impactcell.physics.memory_layout`."""


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
    ChannelSamples
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
    table = build_law_table(tuple(plant.effects), batches)
    columns = tap_columns([tap])
    columns["initial_speed_m_s"][0] = initial_speed_m_s
    values = parameter_vector(plant, table, batches)[None, :]
    taps = undriven(table.tap_parameters(values, plant.gravity_m_s2, columns), table.laws)
    outputs = np.empty((1, at.OUTPUT_COUNT))
    kinds = np.empty(MAX_EVENTS, dtype=np.int64)
    times = np.empty(MAX_EVENTS)
    sample_index = np.zeros((1, at.SAMPLE_INDEX_COUNT), dtype=np.int64)
    sample_index[0, at.EVENT_ROOM] = MAX_EVENTS
    asked = SampleArrays(sample_index, NO_SAMPLES, NO_SAMPLES, kinds, times)
    integrate_taps(taps[:], asked[:], outputs, MAX_DURATION_S, at.TO_REST)
    of_tap = outputs[0]
    status = of_tap[at.STATUS]
    if status != at.AT_REST:
        endless = status == at.TOO_MANY_EVENTS or np.isnan(of_tap[at.HALT_TIME])
        raise NoStopError(
            "the part never came to rest: "
            + (
                "the actuator pushed it without end. Command a stroke"
                if endless
                else f"it was still moving after {MAX_DURATION_S:g} s, or ran away. "
                f"{'Less tilt' if 'surface_tilt' in plant.effects else 'A lower velocity'}, or more friction"
            )
        )
    count = min(int(of_tap[at.EVENT_COUNT]), MAX_EVENTS)
    stop = of_tap[at.STOP_TIME]
    return Motion(
        events=tuple(TapEvent(EVENT_KINDS[kinds[i]], float(times[i])) for i in range(count)),
        peak_force_n=float(of_tap[at.PEAK_FORCE]),
        displacement_m=float(of_tap[at.DISPLACEMENT]),
        stop_s=0.0 if np.isnan(stop) else float(stop),
        first_breakaway_s=float(of_tap[at.BREAKAWAY_TIME]),
        last_separation_s=float(of_tap[at.SEPARATION_TIME]),
        distance_after_separation_m=float(of_tap[at.DISTANCE]),
        sampler=partial(_sample, taps),
    )


def _sample(taps: TapArrays, time_s: Samples) -> ChannelSamples:
    """Integrate again, now with samples: it costs less than keeping every step would."""
    n = time_s.size
    sample_index = np.array([[0, n, 2 * n, 3 * n, n, 2 * n, 3 * n, 4 * n, 0]], dtype=np.int64)
    ascends = bool((time_s[1:] >= time_s[:-1]).all())
    order = None if ascends else np.argsort(time_s, kind="stable")
    ascending = time_s if order is None else time_s[order]
    channel_times = np.concatenate((ascending, ascending, ascending, ascending))
    channels = sample_taps(taps, sample_index, channel_times).reshape(4, n)
    if order is not None:
        channels[:, order] = channels.copy()
    return ChannelSamples(*channels)
