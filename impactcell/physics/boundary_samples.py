"""Samples before the first and after the last phase, and the outputs of a finished tap."""

import math

import numpy as np

from impactcell.numerics.jit import FloatPointer, IntPointer, compiled
from impactcell.physics import memory_layout as at
from impactcell.physics.forces import actuator_speed, body_force, contact_force, derivative, sensor_reading
from impactcell.physics.memory_layout import SmoothPhase, StepBuffers, TapRecord

ELASTIC_PERIODS = 3.0
"""Periods of ringing in elastic stick after which a part counts as at rest: it will not slip any more."""
FORCE_BALANCE = 1e-13
"""Remaining force, in units of the part's weight, at which the position of rest is solved: rounding."""


@compiled
def fill_before_contact(begin_s: float, state: FloatPointer, phase: SmoothPhase, record: TapRecord) -> None:
    """Fill the samples before the first phase: everything as it begins, no force on the sensor."""
    index, times = record.sample_index, record.sample_times
    for channel in range(at.CHANNEL_COUNT):
        value = 0.0
        late = 0.0
        if channel == at.FORCE:
            value = sensor_reading(0.0, phase)
            late = phase.cache[at.DELAY_S]
        elif channel == at.PART_VELOCITY:
            value = phase.parameters[at.DIRECTION] * state[at.PART_SPEED]
        i = index[channel]
        while i < index[at.CHANNEL_COUNT + channel] and times[i] - late < begin_s:
            record.samples[i] = value
            i += 1
        index[channel] = i


@compiled
def last_sample_time(phase: SmoothPhase, record: TapRecord) -> float:
    """Time up to which the motion has to be known for all samples [s]."""
    index, times = record.sample_index, record.sample_times
    last = -np.inf
    for channel in range(at.CHANNEL_COUNT):
        end = index[at.CHANNEL_COUNT + channel]
        if end > index[channel]:
            last = max(last, times[end - 1] - (phase.cache[at.DELAY_S] if channel == at.FORCE else 0.0))
    return last


@compiled
def all_sampled(index: IntPointer) -> bool:
    """Whether every sample asked for has been filled."""
    for channel in range(at.CHANNEL_COUNT):  # noqa: SIM110  # compiled
        if index[channel] < index[at.CHANNEL_COUNT + channel]:
            return False
    return True


@compiled
def resting_force(t: float, state: FloatPointer, phase: SmoothPhase) -> float:
    """Contact force in the present state [N]."""
    return contact_force(state, actuator_speed(t, state, phase), phase)


@compiled
def fill_after_end(t: float, state: FloatPointer, phase: SmoothPhase, record: TapRecord) -> None:
    """Fill the samples after the last phase: everything stays as it is, lagging sensors settle."""
    index, times = record.sample_index, record.sample_times
    force = resting_force(t, state, phase)
    sign = phase.parameters[at.DIRECTION]
    for i in range(index[at.FORCE], index[at.CHANNEL_COUNT + at.FORCE]):
        shown = force
        if phase.cache[at.LAG_S] > 0.0:
            since = times[i] - phase.cache[at.DELAY_S] - t
            shown += (phase.cache[at.LAGGED_FORCE] - force) * math.exp(-since / phase.cache[at.LAG_S])
        record.samples[i] = sensor_reading(shown, phase)
    for i in range(index[at.POSITION], index[at.CHANNEL_COUNT + at.POSITION]):
        place = state[at.ADVANCE]
        if phase.cache[at.POSITION_LAG_S] > 0.0:
            behind = phase.cache[at.LAGGED_POSITION] - place
            place += behind * math.exp((t - times[i]) / phase.cache[at.POSITION_LAG_S])
        record.samples[i] = sign * place
    for i in range(index[at.ACTUATOR], index[at.CHANNEL_COUNT + at.ACTUATOR]):
        record.samples[i] = sign * state[at.TRAVEL]
    for i in range(index[at.PART_VELOCITY], index[at.CHANNEL_COUNT + at.PART_VELOCITY]):
        record.samples[i] = sign * state[at.PART_SPEED]


@compiled
def fill_unknown(record: TapRecord) -> None:
    """Fill the samples that a motion given up has not reached: NaN, so that no fit takes them for a rest."""
    index = record.sample_index
    for channel in range(at.CHANNEL_COUNT):
        for i in range(index[channel], index[at.CHANNEL_COUNT + channel]):
            record.samples[i] = np.nan


@compiled
def is_at_rest(t: float, phase: SmoothPhase, step: StepBuffers, record: TapRecord) -> bool:
    """Whether a part that nothing drives any more has come to rest and all is known of it.

    In elastic stick without a force it rests. Under a force it would ring for ever: it counts as at rest
    when it has not broken away for some periods, and is followed on only for samples.
    """
    state, rates, outputs = step.state, step.stages, record.outputs
    if phase.contact_mode[at.SLIP] == 0:
        outputs[at.STATUS] = at.AT_REST
        return True
    if phase.contact_mode[at.SLIP] != at.ELASTIC:
        phase.cache[at.RESTING_FROM_S] = np.inf
        outputs[at.STATUS] = at.STILL_MOVING
        return False
    phase.cache[at.RESTING_FROM_S] = min(phase.cache[at.RESTING_FROM_S], t)
    derivative(t, state, phase, rates, 0 * at.STATE_WIDTH)
    still = rates[at.PART_SPEED] == 0.0 and state[at.PART_SPEED] == 0.0
    period = 2.0 * np.pi * math.sqrt(phase.parameters[at.MASS] / phase.cache[at.STICK_STIFFNESS])
    if still or t >= phase.cache[at.RESTING_FROM_S] + ELASTIC_PERIODS * period:
        outputs[at.STATUS] = at.AT_REST
        return still or all_sampled(record.sample_index)
    return False


@compiled
def elastic_rest(t: float, state: FloatPointer, phase: SmoothPhase) -> float:
    """Position at which elastic stick holds whatever still pulls at the part: where its ringing would end."""
    state[at.PART_SPEED] = 0.0
    state[at.ADVANCE] = phase.cache[at.ANCHOR]
    for _ in range(20):
        anchor_force = phase.cache[at.STICK_STIFFNESS] * (state[at.ADVANCE] - phase.cache[at.ANCHOR])
        pull = resting_force(t, state, phase) + body_force(t, state, phase) - anchor_force
        stiffness = phase.cache[at.STICK_STIFFNESS]
        if phase.contact_mode[at.ZONE] == at.TOUCHING:
            stiffness += phase.parameters[at.STIFFNESS]
        state[at.ADVANCE] += pull / stiffness
        if abs(pull) < FORCE_BALANCE * phase.parameters[at.MASS] * phase.parameters[at.GRAVITY]:
            break
    return state[at.ADVANCE]


@compiled
def finish_outputs(t: float, state: FloatPointer, phase: SmoothPhase, outputs: FloatPointer) -> None:
    """Turn what was noted on the way into the outputs of the tap."""
    rest = state[at.ADVANCE]
    if phase.contact_mode[at.SLIP] == at.ELASTIC:
        rest = elastic_rest(t, state, phase)
    outputs[at.DISPLACEMENT] = rest
    outputs[at.DISTANCE] = rest - outputs[at.DISTANCE]
    if phase.contact_mode[at.ZONE] == at.ABSENT:
        outputs[at.PEAK_FORCE] = np.nan
        return
    if phase.cache[at.LAG_S] > 0.0 and outputs[at.STATUS] == at.AT_REST:
        # A part held against the actuator keeps loading the sensor after all has come to rest.
        outputs[at.PEAK_FORCE] = max(outputs[at.PEAK_FORCE], resting_force(t, state, phase))
    outputs[at.PEAK_FORCE] = sensor_reading(outputs[at.PEAK_FORCE], phase)
