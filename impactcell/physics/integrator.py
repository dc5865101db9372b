"""The course of one tap: smooth phases, each taken in large steps, joined at located events."""

import math

import numpy as np

from impactcell.numerics.jit import (
    FloatPointer,
    IntArray,
    IntPointer,
    advance,
    compiled,
    float_pointer,
    int_pointer,
)
from impactcell.physics import memory_layout as at
from impactcell.physics.boundary_samples import after_end, before_contact, finish, last_sample, rests
from impactcell.physics.events import first_event, margin, next_kink, state_at
from impactcell.physics.mode_transitions import (
    begin,
    clear,
    enter_first_interval,
    enter_interval,
    note_breakaway,
    pass_event,
    prepare,
    touch,
)
from impactcell.physics.runge_kutta import EXTENDED, STAGES, error, interpolant, stages
from impactcell.physics.sampling import POWERS, record
from impactcell.records import Samples

MOST_EVENTS = 20_000
MOST_STEPS = 20_000_000
LONGEST_STEP_S = 0.02
WORK = (12 + EXTENDED) * at.WIDTH + at.MEMOS + 2 * POWERS


@compiled
def locate(
    event: int,
    t: float,
    h: float,
    fraction: float,
    z: FloatPointer,
    new: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    K: FloatPointer,
    dense: FloatPointer,
    scratch: FloatPointer,
) -> float:
    """Length of the step that ends exactly at the event; K, `new` and `dense` become that step's.

    Newton's method on full steps: the interpolant only gives the first guess and the slope.
    """
    delta = 1e-3 * fraction
    state_at(fraction + delta, mode[at.STATES], dense, scratch)
    above = margin(event, t + (fraction + delta) * h, scratch, mode, memo, row, program)
    state_at(fraction - delta, mode[at.STATES], dense, scratch)
    below = margin(event, t + (fraction - delta) * h, scratch, mode, memo, row, program)
    slope = (above - below) / (2.0 * delta * h)
    length = fraction * h
    for attempt in range(4):
        stages(1, STAGES + 1, t, length, z, mode, memo, row, program, K, scratch)
        for i in range(mode[at.STATES]):
            new[i] = scratch[i]
        change = -margin(event, t + length, new, mode, memo, row, program) / slope
        if attempt == 3 or not 1e-13 * h < abs(change) < 0.1 * h or length + change <= 0.0:
            break
        length += change
    stages(STAGES + 1, EXTENDED, t, length, z, mode, memo, row, program, K, scratch)
    interpolant(mode[at.STATES], length, z, new, K, dense)
    return length


@compiled
def follow(
    row: FloatPointer,
    program: IntPointer,
    drive: FloatPointer,
    drives: int,
    horizon: float,
    goal: int,
    cursor: IntPointer,
    times: FloatPointer,
    out: FloatPointer,
    event_kinds: IntPointer,
    event_times: FloatPointer,
    figures: FloatPointer,
    work: FloatPointer,
    mode: IntPointer,
) -> None:
    """Integrate one tap; all arrays are bare pointers, `integrate_all` says what they hold."""
    n = at.EXTRA + (program[at.LOSS + 1] - program[at.LOSS]) // 2
    z, new, scratch = advance(work, 0), advance(work, at.WIDTH), advance(work, 2 * at.WIDTH)
    K = advance(work, 3 * at.WIDTH)
    dense = advance(work, (3 + EXTENDED) * at.WIDTH)
    memo = advance(work, (11 + EXTENDED) * at.WIDTH)
    powers = advance(work, (11 + EXTENDED) * at.WIDTH + at.MEMOS)
    moments = advance(work, (11 + EXTENDED) * at.WIDTH + at.MEMOS + POWERS)
    found = advance(work, (11 + EXTENDED) * at.WIDTH + at.MEMOS + 2 * POWERS)
    for i in range(WORK):
        work[i] = 0.0
    clear(n, mode, figures)
    t = 0.0 if drives < 2 else drive[0]
    prepare(t, memo, row, program)
    if drives > 1:
        enter_first_interval(t, drive, drives, mode, memo, row, program)
    begin(t, z, mode, memo, row, program)
    if (mode[at.SLIP] == 1 or mode[at.SLIP] == -1) and z[at.SPEED_OF_PART] == 0.0:
        note_breakaway(t, figures, cursor, event_kinds, event_times)
    before_contact(t, row, program, z, memo, cursor, times, out)
    last = horizon
    if goal == at.TO_LAST_SAMPLE:
        last = last_sample(memo, cursor, times) + 1e-9
        if drives < 2:
            last = min(last, horizon)
    h = memo[at.NATURAL_STEP_S]
    fresh = True
    steps = 0
    most_events = MOST_EVENTS + 10 * drives
    while t < last:
        if mode[at.RUNNING] == 0 and drives < 2 and rests(t, z, mode, memo, row, program, cursor, figures, K):
            break
        limit = min(last, memo[at.NEXT_KINK_S])
        if drives > 1:
            limit = min(limit, drive[mode[at.INTERVAL] + 1] - memo[at.DELAY_S])
        whole = limit - (t + h) < 1e-3 * h
        step = limit - t if whole else h
        stages(0 if fresh else 1, STAGES + 1, t, step, z, mode, memo, row, program, K, scratch)
        for i in range(n):
            new[i] = scratch[i]
        err = error(n, step, z, new, K)
        fresh = False
        steps += 1
        if steps > MOST_STEPS or figures[at.EVENT_COUNT] > most_events:
            figures[at.STATUS] = at.TOO_MANY_EVENTS
            break
        if not math.isfinite(err):
            if step < 1e-15:
                figures[at.STATUS] = at.NOT_FINITE
                break
            h = 0.1 * step
            continue
        if err > 1.0 and step > 1e-14:
            h = step * max(0.2, 0.9 * err**-0.125)
            continue
        natural = step * (6.0 if err < 1e-6 else min(6.0, 0.9 * err**-0.125))
        stages(STAGES + 1, EXTENDED, t, step, z, mode, memo, row, program, K, scratch)
        interpolant(n, step, z, new, K, dense)
        event = -1
        if first_event(t, step, dense, scratch, mode, memo, row, program, found):
            event = int(found[0])
            whole = False
            if found[1] > 0.0:
                step = locate(event, t, step, found[1], z, new, mode, memo, row, program, K, dense, scratch)
            else:
                step = 0.0
        if step > 0.0:
            record(
                t,
                step,
                dense,
                scratch,
                mode,
                memo,
                row,
                program,
                powers,
                moments,
                cursor,
                times,
                out,
                figures,
            )
            for i in range(n):
                z[i] = new[i]
                K[i] = K[STAGES * at.WIDTH + i]
        t = limit if whole else t + step
        if not whole or natural > h:
            h = min(natural, LONGEST_STEP_S)
        if event >= 0:
            pass_event(event, t, z, mode, memo, row, program, figures, cursor, event_kinds, event_times)
            fresh = True
        if whole and t >= memo[at.NEXT_KINK_S]:
            memo[at.NEXT_KINK_S] = next_kink(t, row, program)
            touch(t, z, mode, row, program)
            fresh = True
        if whole and drives > 1 and t >= drive[mode[at.INTERVAL] + 1] - memo[at.DELAY_S]:
            if mode[at.INTERVAL] + 2 >= drives:
                break
            enter_interval(mode[at.INTERVAL] + 1, drive, drives, mode, memo, row, program)
            fresh = True
    if t >= horizon and mode[at.SLIP] == 0:
        # Held for good: the actuator has stalled against it, or nothing drives it any more.
        figures[at.STATUS] = at.AT_REST
    figures[at.STEP_COUNT] = steps
    after_end(t, z, mode, memo, row, program, cursor, times, out)
    finish(t, z, mode, memo, row, program, figures)


@compiled
def integrate_all(
    rows: Samples,
    program: IntArray,
    drives: Samples,
    drive_ends: IntArray,
    horizon: float,
    goal: int,
    cursors: IntArray,
    times: Samples,
    out: Samples,
    event_kinds: IntArray,
    event_times: Samples,
    figures: Samples,
) -> None:
    """Integrate n taps.

    Parameters
    ----------
    rows : ndarray, shape (n, width)
        See `impactcell.physics.memory_layout`, as for `program`.
    drives : ndarray
        For each tap the times, then the values, of a driving force along +1, linear in between.
    drive_ends : ndarray, shape (n + 1,)
        Where each tap's part of `drives` ends; equal to the one before where nothing drives.
    horizon : float
        Longest time to integrate [s].
    goal : int
        TO_REST, for the figures, or TO_LAST_SAMPLE.
    cursors : ndarray, shape (n, CURSORS)
        For each channel the index of its first sample and the index after its last; room for events.
        They are used up.
    times, out : ndarray
        Sample times, sorted within each channel, and where the samples go.
    event_kinds, event_times : ndarray
        Filled with as many events of the last tap as there is room for.
    figures : ndarray, shape (n, FIGURES)
        What came out.
    """
    work = np.empty(WORK)
    mode = np.empty(at.MODES, np.int64)
    for i in range(rows.shape[0]):
        follow(
            float_pointer(rows[i]),
            int_pointer(program),
            float_pointer(drives[drive_ends[i] :]),
            (drive_ends[i + 1] - drive_ends[i]) // 2,
            horizon,
            goal,
            int_pointer(cursors[i]),
            float_pointer(times),
            float_pointer(out),
            int_pointer(event_kinds),
            float_pointer(event_times),
            float_pointer(figures[i]),
            float_pointer(work),
            int_pointer(mode),
        )
    # A last use keeps the workspace alive while bare pointers into it are in use.
    mode[0] = work.shape[0]
