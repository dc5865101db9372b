"""What a held-out stretch itself has to say before a model runs on it: first state, and constant force.

Neither is of the machine. Both are the stretch's own for every model that is simulated on it.
"""

from collections.abc import Callable, Sequence

import numpy as np

from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.terms.base_model import BaseModel, Response
from impactcell.records import Samples

START_SAMPLES = 5
"""Samples at either side by which the first speed is looked for at first [samples]."""
START_PERIODS = 1.0
"""Periods of the motion, or a quarter of a stretch, by which its first state is fitted."""
START_NUDGE = 1e-3
"""Size of the nudges that tell how a motion follows from its first state, over its range."""
PULLING_BACK = frozenset(("restoring_force", "hardening_spring"))
"""Terms that bring a part back to a place."""
OFFSET_NUDGE = 1e-3
"""Constant force that tells how far a motion drifts by one, over the largest of the drive."""
OFFSET_STEPS, RECORD_STEPS = 2, 5
"""Runs by which it is found after each fit of the first state; but for friction drift is linear.
The second where each record has one of its own, of the size of friction."""


def between_gaps(
    record: UniformRecord, begin_s: float, end_s: float, least_s: float
) -> list[tuple[float, float]]:
    """Cut what is held out of a record at its gaps: what happened meanwhile moves the part, and is not known.

    A model begins anew after each, from a first state of its own; pieces shorter than `least_s` are left out
    where one is longer, since its first state takes most of them.
    """
    if not record.gaps:
        return [(begin_s, end_s)]
    times = [record.time_s[piece] for piece in record.pieces()]
    inside = [time[(time >= begin_s) & (time <= end_s)] for time in times]
    pieces = [(float(time[0]), float(time[-1])) for time in inside if time.size]
    long = [(begin, end) for begin, end in pieces if end - begin >= least_s]
    return long or [max(pieces, key=lambda piece: piece[1] - piece[0])]


def first_state(position: Samples, step: float) -> tuple[float, float]:
    """Position and speed at the first sample, by a parabola."""
    time = step * np.arange(min(4 * START_SAMPLES + 1, len(position)))
    curve = np.polynomial.Polynomial.fit(time, position[: len(time)], 3)
    return float(curve(0.0)), float(curve.deriv()(0.0))


def settled_start(
    run: Callable[[Samples], Samples], start: Samples, measured: Sequence[Samples], begin: Sequence[int]
) -> Samples:
    """First states, shape (2, lanes), by least squares of a model over the begin of each stretch.

    The speed that a few samples show errs by more than the model does; one Gauss-Newton step from it.
    """
    reached = [float(np.ptp(values)) for values in measured]
    nudge = START_NUDGE * np.array([reached, reached])
    nudge[1] *= np.abs(start[1]).max() / max(*reached, np.finfo(float).tiny) + 1.0
    plain = run(start)
    moved = [run(start + nudge * np.array([[1.0 - axis], [axis]])) - plain for axis in (0.0, 1.0)]
    settled = start.copy()
    for lane, (values, count) in enumerate(zip(measured, begin, strict=True)):
        slopes = np.stack([change[:count, lane] for change in moved], axis=1)
        left = values[:count] - plain[:count, lane]
        step = np.linalg.lstsq(slopes, left, rcond=1e-6)[0] * nudge[:, lane]
        settled[:, lane] += step
    after = run(settled)
    for lane, (values, count) in enumerate(zip(measured, begin, strict=True)):
        errors = [float(np.sum((values[:count] - out[:count, lane]) ** 2)) for out in (plain, after)]
        if not errors[1] < errors[0]:
            settled[:, lane] = start[:, lane]
    return settled


def drifts(base: BaseModel) -> bool:
    """Whether each stretch that is simulated needs a constant force of its own, found from its position.

    It does where each record has one, and where one adds up that the base model leaves open: nothing pulls
    back then, and what the zero of the force moves between two records, tenths of a per cent of it, carries
    the part away, and says nothing of any term.
    """
    if base.response is not Response.POSITION or base.force_offset.is_held:
        return False
    pulls = pulls_back(base) or any(choice.law for choice in base.terms)
    return base.force_offset_by_record or not pulls


def pulls_back(base: BaseModel) -> bool:
    """Whether the base model has what brings a part back to a place: gravity, or a spring."""
    return base.has_gravity or any(choice.identifier in PULLING_BACK for choice in base.terms)


def constant_forces(
    run: Callable[[Samples], Samples],
    drives_and_measured: tuple[Sequence[Samples], Sequence[Samples]],
    constant: Samples,
    reach: float,
    steps: int = OFFSET_STEPS,
) -> Samples:
    """Constant force of each lane by least squares of its positions, shape (lanes,).

    Where nothing drives at all it stays where it begins: friction alone moves nothing, and takes it.

    Parameters
    ----------
    run : callable
        Positions (samples, 2 lanes) under constant forces of shape (2 lanes,): every lane twice.
    drives_and_measured : (sequence, sequence) of ndarray
        Force and position of each lane.
    constant : ndarray, shape (lanes,)
        Where to begin.
    reach : float
        How large it may be [N or N m].
    steps : int
        By which it is found.
    """
    drives, measured = drives_and_measured
    lanes = len(measured)
    largest = np.array([float(np.abs(drive).max()) for drive in drives])
    if not largest.any():
        return constant
    nudge = OFFSET_NUDGE * np.where(largest > 0.0, largest, largest.max())
    best, least = constant, np.full(lanes, np.inf)
    for _ in range(steps):
        both = run(np.concatenate([constant, constant + nudge]))
        plain, slopes = both[:, :lanes], (both[:, lanes:] - both[:, :lanes]) / nudge
        squares = _squares(plain, measured)
        best, least = np.where(squares < least, constant, best), np.minimum(squares, least)
        step = np.zeros(lanes)
        for lane, values in enumerate(measured):
            slope = slopes[: len(values), lane]
            left = float(slope @ (values - plain[: len(values), lane]))
            step[lane] = left / max(float(slope @ slope), np.finfo(float).tiny)
        constant = np.clip(constant + step, -reach, reach)
    return best


def _squares(out: Samples, measured: Sequence[Samples]) -> Samples:
    """Squared error of each lane."""
    return np.array(
        [float(np.sum((values - out[: len(values), lane]) ** 2)) for lane, values in enumerate(measured)]
    )
