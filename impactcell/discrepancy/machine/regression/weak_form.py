"""Records as rows of a linear regression: the equation of motion in its weak form.

With a test function w of compact support, `int w q'' dt = int w'' q dt`: no measured position is
differentiated, and what is sampled fast and slowly averages in the same way. Each row is one place of w, a
quarter of its support from the next one.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine.records.motion_scale import (
    MotionScale,
    carried_load,
    half_supports,
    is_told,
    motion_scale,
)
from impactcell.discrepancy.machine.records.smoothing import bell, smoothed_speed, test_function, test_slope
from impactcell.discrepancy.machine.records.step_forces import force_about
from impactcell.discrepancy.machine.records.travel import periods_of_a_turn
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.terms.base_model import BaseModel, Response, TermChoice
from impactcell.discrepancy.machine.terms.catalogue import MotionState, Term
from impactcell.discrepancy.machine.terms.law_terms import term_of
from impactcell.discrepancy.machine.terms.rival_forms import Freedom, columns_of_corners
from impactcell.records import Samples

IndexArray = np.ndarray[tuple[int], np.dtype[np.int64]]
Column = tuple[str, float, int]
"""A column of the regression: its term or nuisance, the value of its shape, and which strength it is."""

TURNING_SPEED_SHARE = 0.005
"""Speed below which the direction of motion counts as between -1 and 1, over the largest [1]."""
TURNING_NOISES = 2.0
"""And at least this many standard deviations of the speed's noise [1]."""
KINK_SHARE = 0.08
"""Shift of a smoothed speed at a kink, over its change within the smoothing either side: 5/64 for a cubic's
slope over many samples [1]."""
ROWS_A_HALF = 2
"""Rows in half a support: one would take the fast noise of an acceleration for a slow one, and of a slow
decay in a noisy film would tell a third as much [1]."""
MAX_RESTING_SHARE = 0.5
"""Share of a row's support at rest beyond which it says nothing of friction: the part may stick [1]."""
FINER = 9
"""Values between two neighbours of one on the grid of a shape."""
GAIN: Column = ("force_gain", 0.0, 0)
"""Column of what is measured too large of the force."""
INERTIA_BESIDE: Column = ("inertia_beside", 0.0, 0)
"""Column of an inertia beside the stated one, in its unit: of a part that was taken to have none."""
ECCENTRICITY = "position_eccentricity"
"""Columns of an encoder that turns off its centre: e_c and e_s."""


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows of the regression.

    Attributes
    ----------
    target : ndarray, shape (n,)
        I q'' - F + G sin q at the values of the base model.
    columns : mapping
        Generalised force per unit of each strength and nuisance, shape (n,).
    record, time_s : ndarray, shape (n,)
        Place of the record, and centre of the test function in it.
    variance : ndarray, shape (n,)
        Of the target by the sensors' noise alone.
    doubt : ndarray, shape (n,)
        Share of the row in which the direction of motion is not known: 0 where the part slides all along.
    """

    target: Samples
    columns: Mapping[Column, Samples]
    record: Samples
    time_s: Samples
    variance: Samples
    doubt: Samples

    def only(self, columns: Iterable[Column]) -> "Rows":
        """Rows without all other columns: sums of products over blocks go by the square of their number."""
        return replace(self, columns={column: self.columns[column] for column in columns})


def build_rows(
    records: Sequence[UniformRecord],
    base: BaseModel,
    shapes: Mapping[TermChoice, Sequence[float]],
    gravity_and_delay: tuple[float, float],
    freedom: Freedom = columns_of_corners,
    stiffness: float = 0.0,
) -> Rows:
    """Rows of all records with a column for every term, shape and nuisance.

    Parameters
    ----------
    records : sequence of UniformRecord
    base : BaseModel
    shapes : mapping
        Terms, those of the base model among them, and the values of the shape of each.
    gravity_and_delay : (float, float)
        G as it is known so far, by which load and zero of the position go, and how late the force was
        recorded.
    freedom : callable
        Gives columns beside those of nuisances and terms.
    stiffness : float
        Of a spring as it is known so far, by which the noise of a row goes [N/m or N m/rad].
    """
    scale = motion_scale(records, base.response, gravity_and_delay[0])
    parts = [
        _record_rows(record, base, shapes, (*gravity_and_delay, stiffness), (scale, freedom))
        for record in records
    ]
    return Rows(
        np.concatenate([part.target for part in parts]),
        {name: np.concatenate([part.columns[name] for part in parts]) for name in parts[0].columns},
        np.concatenate([np.full(part.target.size, place) for place, part in enumerate(parts)]),
        np.concatenate([part.time_s for part in parts]),
        np.concatenate([part.variance for part in parts]),
        np.concatenate([part.doubt for part in parts]),
    )


def _record_rows(
    record: UniformRecord,
    base: BaseModel,
    shapes: Mapping[TermChoice, Sequence[float]],
    known: tuple[float, float, float],
    scale_and_freedom: tuple[MotionScale, Freedom],
) -> Rows:
    gravity, delay_s, stiffness = known
    scale, freedom = scale_and_freedom
    step = record.step_s
    half, narrow = half_supports(record, scale)
    weight, curvature = test_function(half, step)
    pushing = weight if record.command is None else bell(half)
    slope = test_slope(pushing, step)
    velocity = smoothed_speed(record.position, narrow, step)
    noise_of_speed = record.speed_noise(narrow)
    force = force_about(record, delay_s)
    load = carried_load(base.response, record, force, (gravity, scale))
    apart = max(half // ROWS_A_HALF, 1)
    centres: IndexArray = np.arange(half + narrow, len(force) - half - narrow, apart, dtype=np.int64)
    centres = centres[is_told(record, scale)[centres]]
    direction = direction_of_motion(velocity, scale, noise_of_speed)
    resting = _averaged((np.abs(direction) < 1.0).astype(np.float64), weight, centres)
    centres = centres[resting <= MAX_RESTING_SHARE]
    acceleration = _averaged(record.position, curvature, centres)
    accelerating = record.inertia * acceleration
    one = np.ones(len(force))
    raw: dict[Column, Samples] = {
        GAIN: force,
        ("force_offset", 0.0, 0): one,
        ("gravity_torque", 0.0, 0): -np.sin(record.position),
        ("position_offset", 0.0, 0): gravity * np.cos(record.position),
    }
    for choice, values_of_shape in shapes.items():
        term = term_of(choice)
        value = record.covariates.get(choice.covariate, 0.0)
        motion = MotionState(record.position, velocity, load, value * one)
        for shape in values_of_shape:
            for number, feature in enumerate(term.features(motion, shape)):
                raw[choice.name, shape, number] = -direction * feature if term.is_friction else feature
    motion = MotionState(record.position, velocity, load, one)
    raw |= freedom(motion, direction, scale.ranges)
    columns = {
        name: _averaged(values, pushing if name == GAIN else weight, centres) for name, values in raw.items()
    }
    if base.coordinate is Coordinate.ROTATION:
        # The angle is what is read less e_c cos q + e_s sin q: to first order a force by inertia and gravity.
        for number, wave in enumerate(eccentricity_waves(record.position)):
            columns[ECCENTRICITY, 0.0, number] = record.inertia * _averaged(wave, curvature, centres)
            columns[ECCENTRICITY, 0.0, number] += _averaged(
                gravity * np.cos(record.position) * wave, weight, centres
            )
    columns["inertia", 0.0, 0] = -accelerating
    columns[INERTIA_BESIDE] = -acceleration
    if base.response is Response.FORCE:
        # What is measured is the gain times what a rigid machine would need, and friction in its own unit.
        columns[GAIN] = gravity * columns["gravity_torque", 0.0, 0] - accelerating
    gravitating = base.gravity_torque.value * np.sin(record.position)
    target = accelerating - _averaged(force - gravitating, weight, centres)
    if pushing is not weight:
        target -= _averaged(force, pushing - weight, centres)
    # F(t + d) is linear in d about the delay of now, and counted from the one that is stated.
    columns["delay_s", 0.0, 0] = _averaged(force, slope, centres)
    target += (delay_s - base.delay_s.value) * columns["delay_s", 0.0, 0]
    sensors = _variance_by_position(record, centres, (weight, curvature), (gravity, stiffness))
    sensors = sensors + record.noise[1] ** 2 * float(weight @ weight)
    return Rows(
        target,
        columns,
        np.zeros(target.size),
        record.time_s[centres],
        sensors,
        _averaged(doubt_of_direction(velocity, scale, noise_of_speed, narrow), weight, centres),
    )


def _variance_by_position(
    record: UniformRecord,
    centres: IndexArray,
    test: tuple[Samples, Samples],
    pulls: tuple[float, float],
) -> Samples:
    """Variance of I q'' + G sin q + k q of each row by the position's noise, shape (n,).

    Of weights I w'' + (G cos q + k) w: over a whole swing the two are as large, and of one noise.
    """
    weight, curvature = test
    gravity, stiffness = pulls
    if (gravity, stiffness) == (0.0, 0.0) or record.summed_up:
        gain = record.inertia**2 * record.noise_gain(curvature)
        return np.full(centres.size, record.noise[0] ** 2 * gain)
    half = len(weight) // 2
    pulling = gravity * np.cos(record.position) + stiffness
    windows = np.lib.stride_tricks.sliding_window_view(pulling, len(weight))
    weights = record.inertia * curvature + windows[centres - half] * weight
    variance: Samples = record.noise[0] ** 2 * np.einsum("ij,ij->i", weights, weights)
    return variance


def residual_of(rows: Rows, columns: Sequence[Column], coefficients: Samples) -> Samples:
    """Give what a model leaves of each row, shape (n,)."""
    explained = sum(
        (value * rows.columns[column] for column, value in zip(columns, coefficients, strict=True)),
        np.zeros(rows.target.shape),
    )
    left: Samples = rows.target - explained
    return left


def eccentricity_waves(position: Samples) -> Samples:
    """Return what an encoder off its centre reads beside the angle, per unit of e_c and e_s: (2, n)."""
    return np.stack([np.cos(position), np.sin(position)])


def direction_of_motion(velocity: Samples, scale: MotionScale, speed_noise: float) -> Samples:
    """-1 or 1, and between them where the part turns or rests, shape (n,)."""
    direction: Samples = np.clip(velocity / _turning_speed(scale, speed_noise), -1.0, 1.0)
    return direction


def doubt_of_direction(velocity: Samples, scale: MotionScale, speed_noise: float, narrow: int) -> Samples:
    """1 at rest, 0 where the part surely slides, shape (n,).

    Friction that turns makes a kink in the speed, which is shifted by smoothing over `narrow` samples on
    either side, and lies anywhere between two samples.
    """
    padded = np.pad(velocity, narrow, mode="edge")
    change = np.abs(padded[2 * narrow :] - padded[: -2 * narrow])
    shift = max(KINK_SHARE, 0.5 / narrow) * change
    sure = np.abs(velocity) / (_turning_speed(scale, speed_noise) + shift)
    doubt: Samples = np.maximum(1.0 - sure, 0.0)
    return doubt


def _turning_speed(scale: MotionScale, speed_noise: float) -> float:
    return max(TURNING_SPEED_SHARE * scale.speed, TURNING_NOISES * speed_noise)


def shape_grid(term: Term, scale: MotionScale) -> tuple[float, ...]:
    """Values of a term's shape that are tried; (0,) where it has none."""
    if term.shape is None:
        return (0.0,)
    if is_of_turns(term, scale):
        return periods_of_a_turn(scale.high - scale.low)
    size = scale.speed if term.shape.covariate == "speed" else scale.high - scale.low
    return tuple(share * size for share in term.shape.shares)


def is_of_turns(term: Term, scale: MotionScale) -> bool:
    """Whether a term repeats with each turn or a part of it, and by nothing else."""
    return term.shape is not None and term.shape.name == "period" and scale.many_turns


def finer_grid(grid: Sequence[float], shape: float) -> tuple[float, ...]:
    """Values between the neighbours of one on a grid."""
    place = list(grid).index(shape)
    low, high = grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)]
    return tuple(sorted({shape, *map(float, np.geomspace(low, high, FINER))}))


def _averaged(values: Samples, weight: Samples, centres: IndexArray) -> Samples:
    half = len(weight) // 2
    windows = np.lib.stride_tricks.sliding_window_view(values, len(weight))
    averaged: Samples = windows[centres - half] @ weight
    return averaged
