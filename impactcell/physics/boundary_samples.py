"""Numbers before the first and after the last phase, and the figures of a finished tap."""

import math

import numpy as np

from impactcell.numerics.jit import FloatPointer, IntPointer, compiled
from impactcell.physics import memory_layout as at
from impactcell.physics.forces import actuator_speed, body_force, contact_force, derivative, reading

ELASTIC_PERIODS = 3.0


@compiled
def before_contact(
    begin_s: float,
    row: FloatPointer,
    program: IntPointer,
    z: FloatPointer,
    memo: FloatPointer,
    cursor: IntPointer,
    times: FloatPointer,
    out: FloatPointer,
) -> None:
    """Fill the samples before the first phase: everything as it begins, no force on the sensor."""
    for channel in range(at.CHANNELS):
        value = 0.0
        late = 0.0
        if channel == at.FORCE:
            value = reading(0.0, row, program)
            late = memo[at.DELAY_S]
        elif channel == at.PART_VELOCITY:
            value = row[at.DIRECTION] * z[at.SPEED_OF_PART]
        i = cursor[channel]
        while i < cursor[at.CHANNELS + channel] and times[i] - late < begin_s:
            out[i] = value
            i += 1
        cursor[channel] = i


@compiled
def last_sample(memo: FloatPointer, cursor: IntPointer, times: FloatPointer) -> float:
    """Time up to which the motion has to be known for all samples [s]."""
    last = -np.inf
    for channel in range(at.CHANNELS):
        end = cursor[at.CHANNELS + channel]
        if end > cursor[channel]:
            last = max(last, times[end - 1] - (memo[at.DELAY_S] if channel == at.FORCE else 0.0))
    return last


@compiled
def all_taken(cursor: IntPointer) -> bool:
    """Whether every sample asked for has been filled."""
    for channel in range(at.CHANNELS):  # noqa: SIM110  # compiled
        if cursor[channel] < cursor[at.CHANNELS + channel]:
            return False
    return True


@compiled
def resting_force(
    t: float, z: FloatPointer, mode: IntPointer, row: FloatPointer, program: IntPointer
) -> float:
    """Contact force in the present state [N]."""
    return contact_force(z, actuator_speed(t, z, mode, row, program), mode, row, program)


@compiled
def after_end(
    t: float,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    cursor: IntPointer,
    times: FloatPointer,
    out: FloatPointer,
) -> None:
    """Fill the samples after the last phase: everything stays as it is, a lagging sensor settles."""
    force = resting_force(t, z, mode, row, program)
    sign = row[at.DIRECTION]
    for i in range(cursor[at.FORCE], cursor[at.CHANNELS + at.FORCE]):
        shown = force
        if memo[at.LAG_S] > 0.0:
            since = times[i] - memo[at.DELAY_S] - t
            shown += (memo[at.LAGGED_FORCE] - force) * math.exp(-since / memo[at.LAG_S])
        out[i] = reading(shown, row, program)
    for channel in range(1, at.CHANNELS):
        value = sign * z[at.SPEED_OF_PART]
        if channel != at.PART_VELOCITY:
            value = sign * z[at.U if channel == at.POSITION else at.TRAVEL]
        for i in range(cursor[channel], cursor[at.CHANNELS + channel]):
            out[i] = value


@compiled
def rests(
    t: float,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    cursor: IntPointer,
    figures: FloatPointer,
    K: FloatPointer,
) -> bool:
    """Whether a part that nothing drives any more has come to rest and all is known of it.

    In elastic stick without a force it rests. Under a force it would ring for ever: it counts as at rest
    when it has not broken away for some periods, and is followed on only for samples.
    """
    if mode[at.SLIP] == 0:
        figures[at.STATUS] = at.AT_REST
        return True
    if mode[at.SLIP] != at.ELASTIC:
        memo[at.RESTING_FROM_S] = np.inf
        figures[at.STATUS] = at.STILL_MOVING
        return False
    memo[at.RESTING_FROM_S] = min(memo[at.RESTING_FROM_S], t)
    derivative(t, z, mode, memo, row, program, K, 0)
    still = K[at.SPEED_OF_PART] == 0.0 and z[at.SPEED_OF_PART] == 0.0
    period = 2.0 * np.pi * math.sqrt(row[at.MASS] / memo[at.STICK_STIFFNESS])
    if still or t >= memo[at.RESTING_FROM_S] + ELASTIC_PERIODS * period:
        figures[at.STATUS] = at.AT_REST
        return still or all_taken(cursor)
    return False


@compiled
def elastic_rest(
    t: float, z: FloatPointer, mode: IntPointer, memo: FloatPointer, row: FloatPointer, program: IntPointer
) -> float:
    """Position at which elastic stick holds whatever still pulls at the part: where its ringing would end."""
    z[at.SPEED_OF_PART] = 0.0
    z[at.U] = memo[at.ANCHOR]
    for _ in range(20):
        anchor_force = memo[at.STICK_STIFFNESS] * (z[at.U] - memo[at.ANCHOR])
        pull = resting_force(t, z, mode, row, program) + body_force(t, z, memo, row, program) - anchor_force
        stiffness = memo[at.STICK_STIFFNESS]
        if mode[at.ZONE] == at.TOUCHING:
            stiffness += row[at.STIFFNESS]
        z[at.U] += pull / stiffness
        if abs(pull) < 1e-13 * row[at.MASS] * row[at.GRAVITY]:
            break
    return z[at.U]


@compiled
def finish(
    t: float,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    figures: FloatPointer,
) -> None:
    """Turn what was noted on the way into the figures of the tap."""
    rest = z[at.U]
    if mode[at.SLIP] == at.ELASTIC:
        rest = elastic_rest(t, z, mode, memo, row, program)
    figures[at.DISPLACEMENT] = rest
    figures[at.DISTANCE] = rest - figures[at.DISTANCE]
    if mode[at.ZONE] == at.ABSENT:
        figures[at.PEAK_FORCE] = np.nan
        return
    if memo[at.LAG_S] > 0.0 and figures[at.STATUS] == at.AT_REST:
        # A part held against the actuator keeps loading the sensor after all has come to rest.
        figures[at.PEAK_FORCE] = max(figures[at.PEAK_FORCE], resting_force(t, z, mode, row, program))
    figures[at.PEAK_FORCE] = reading(figures[at.PEAK_FORCE], row, program)
