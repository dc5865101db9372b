"""The measured drive of a block made fit for a model, and what its noise does to the positions.

The force that drives the model is measured, and its noise drives the model too: integrated twice it wanders
far above the noise of the positions. A block's residuals are therefore whitened by their whole covariance,

    R = s_x^2 I + G C G',

s_x the noise of the positions, C the covariance of the drive's knots, and G how a knot moves the positions
while the part slips: speed gathers noise / m, is forgotten in a stop, shrinks where the motion turns at once,
and gets a kick where an error of the force is an error of the moment of breakaway.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular, solveh_banded

from impactcell.discrepancy.data.driven_blocks import smoothed_velocity
from impactcell.discrepancy.data.prepared_shots import POSITION, IndexArray, PreparedShot
from impactcell.features import white_noise_std
from impactcell.records import Channel, Samples

MAX_BLOCK_SAMPLES = 80
"""Samples of a block that a fit reads: its whitener is a dense matrix of that size."""
MIN_KNOTS, MAX_KNOTS = 60, 160
"""Knots of a block's drive: enough for its moments of breakaway, few enough for a dense covariance."""
SIGNAL_GROWTH = 4.0
"""Growth of the apparent noise density, when the window doubles, that only a signal makes."""
RESTING_SPEED_SHARE = 0.02
"""Share of a block's largest speed below which the part rests."""
SLIPPING_SPEED_SHARE = 0.15
"""Share above which it slips without doubt."""
MIN_SLIP_SAMPLES = 10
"""Samples of a slip from which on a line through it means anything."""
MAX_SPEED_ERROR_SHARE = 0.5
"""Error of the speed after a breakaway, over the block's largest speed, at one standard deviation."""


@dataclass(frozen=True, slots=True, eq=False)
class SmoothedDrive:
    """A drive, linear between evenly spaced knots, and the density of its noise [N²/Hz, two-sided]."""

    time_s: Samples
    force_n: Samples
    density: float


def whiten_block(shot: PreparedShot, noise_std_m: float, gravity_m_s2: float, mu_k: float) -> PreparedShot:
    """Return a block with a smooth drive, fewer samples and the whitener of its residuals.

    Parameters
    ----------
    shot : PreparedShot
        As recorded.
    mu_k : float
        About what friction is; only the whitener depends on it.
    """
    time, position = shot.times[POSITION], shot.values[POSITION]
    speed = smoothed_velocity(time, position)
    drive = smooth_drive(shot.drive[0], shot.drive[1], float(time[-1]))
    step = max(math.ceil(len(time) / MAX_BLOCK_SAMPLES), 1)
    chosen = time[::step]
    mass = shot.covariates["mass"]
    G = position_response(drive, np.interp(drive.time_s, time, speed), mass, mu_k * mass * gravity_m_s2)
    seen = np.array([np.interp(chosen, drive.time_s, column) for column in G.T]).T
    R = noise_std_m**2 * np.eye(len(chosen)) + seen @ _knot_covariance(drive) @ seen.T
    whitener = solve_triangular(np.linalg.cholesky(R), np.eye(len(chosen)), lower=True)
    empty = np.empty(0)
    return replace(
        shot,
        times=(empty, chosen, empty),
        values=(empty, position[::step], empty),
        drive=np.vstack([drive.time_s, drive.force_n]),
        whitener=whitener,
    )


def smooth_drive(time: Samples, force: Samples, end: float) -> SmoothedDrive:
    """Least squares by a function that is linear between knots over 0 to `end`.

    Unlike interpolation it has no bias of the mean: what it misses is orthogonal to every such function.
    """
    apart = float(np.median(np.diff(time)))
    density, window = _noise_density(force, apart)
    count = int(np.clip(round(end / (2.0 * window)), MIN_KNOTS, MAX_KNOTS))
    count = max(min(count, int(end / apart)), 2)
    knots = np.linspace(min(time[0], 0.0), max(end, time[-1]), count + 1)
    knot_position = np.clip((time - knots[0]) / (knots[1] - knots[0]), 0.0, count - 1e-9)
    knot = knot_position.astype(int)
    share = knot_position - knot
    diagonal = np.bincount(knot, (1.0 - share) ** 2, count + 1) + np.bincount(knot + 1, share**2, count + 1)
    beside = np.bincount(knot, share * (1.0 - share), count + 1)
    moment = np.bincount(knot, (1.0 - share) * force, count + 1) + np.bincount(
        knot + 1, share * force, count + 1
    )
    # A knot without samples, as in a gap, is joined to its neighbours.
    small = 1e-9 * float(diagonal.max())
    banded = np.vstack([np.concatenate([[0.0], beside[:-1] - small]), diagonal + 2.0 * small])
    return SmoothedDrive(knots, solveh_banded(banded, moment), density)


def _noise_density(force: Samples, apart: float) -> tuple[float, float]:
    """Density of the force's noise, and the window of averages in which the drive begins to show.

    Third differences of averages over windows see no slow drive; doubled windows see coloured noise in full.
    """
    window = 1
    density = math.nan
    while len(force) // window >= 16:
        means = force[: len(force) // window * window].reshape(-1, window).mean(axis=1)
        std = white_noise_std(means)
        now = std**2 * window * apart
        if window > 1 and now > SIGNAL_GROWTH * density:
            break
        density, window = now, 2 * window
    return density, 0.5 * window * apart


def _knot_covariance(drive: SmoothedDrive) -> Samples:
    """Covariance of the knots of a drive with white noise."""
    count = len(drive.time_s)
    h = float(drive.time_s[1] - drive.time_s[0])
    overlap = np.diag(np.full(count, 2.0 * h / 3.0))
    overlap[0, 0] = overlap[-1, -1] = h / 3.0
    overlap += np.diag(np.full(count - 1, h / 6.0), 1) + np.diag(np.full(count - 1, h / 6.0), -1)
    return np.asarray(drive.density * np.linalg.inv(overlap))


def position_response(drive: SmoothedDrive, speed: Samples, mass: float, friction: float) -> Samples:
    """Change of the position at every knot with the force at every knot, shape (k, k) [m/N].

    Parameters
    ----------
    speed : ndarray, shape (k,)
        Measured, at the knots.
    friction : float
        Kinetic friction [N].
    """
    count = len(speed)
    h = float(drive.time_s[1] - drive.time_s[0])
    largest = float(np.abs(speed).max())
    moving = np.where(np.abs(speed) > RESTING_SPEED_SHARE * largest, np.sign(speed), 0.0)
    force = np.abs(drive.force_n)
    slope = np.abs(np.gradient(drive.force_n, h))
    knot_std = math.sqrt(drive.density / h)
    velocity_response, position_now = np.zeros(count), np.zeros(count)
    response = np.zeros((count, count))
    for k in range(count - 1):
        if moving[k] == 0.0 and moving[k + 1] != 0.0:
            kick = max(force[k] - friction, 0.0) / mass / max(float(slope[k]), 1e-9)
            velocity_response[k] += min(kick, MAX_SPEED_ERROR_SHARE * largest / max(knot_std, 1e-12))
        position_now = position_now + h * velocity_response
        if moving[k] != 0.0 or moving[k + 1] != 0.0:
            velocity_response = velocity_response.copy()
            position_now[k] += h * h / 3.0 / mass
            position_now[k + 1] += h * h / 6.0 / mass
            velocity_response[k] += 0.5 * h / mass
            velocity_response[k + 1] += 0.5 * h / mass
        if moving[k + 1] == 0.0:
            velocity_response = np.zeros(count)
        elif moving[k] * moving[k + 1] < 0.0:
            velocity_response = (
                velocity_response * max(force[k] - friction, 0.0) / max(force[k] + friction, 1e-12)
            )
        response[k + 1] = position_now
    return response


def friction_of_slip(shots: tuple[PreparedShot, ...], gravity_m_s2: float) -> tuple[float, float]:
    """About what mu_k and mu_s / mu_k are, without any model of stick and slip.

    In slip of one direction the impulse of the drive less the momentum grows by mu_k m g a second; mu_s is
    what the drive is worth where the part breaks away.
    """
    coefficients, weights, breakaway_ratios = [], [], []
    for shot in shots:
        time = shot.times[POSITION]
        speed = smoothed_velocity(time, shot.values[POSITION])
        force = np.interp(time, *shot.drive)
        mass = shot.covariates["mass"]
        impulse_lost = _impulse(time, force) / mass - speed
        for part, sense in _slip_intervals(speed):
            coefficients.append(np.polyfit(time[part], impulse_lost[part], 1)[0] * sense / gravity_m_s2)
            weights.append((time[part[-1]] - time[part[0]]) ** 3)
        resting = np.abs(speed) <= RESTING_SPEED_SHARE * np.abs(speed).max()
        leaves = np.flatnonzero(resting[:-1] & ~resting[1:])
        breakaway_ratios += (np.abs(force[leaves]) / (mass * gravity_m_s2)).tolist()
    if not coefficients:
        return 0.15, 1.2
    order = np.argsort(coefficients)
    share = np.cumsum(np.array(weights)[order])
    mu_k = float(np.clip(coefficients[order[np.searchsorted(share, 0.5 * share[-1])]], 0.005, 2.0))
    ratio = float(np.median(breakaway_ratios)) / mu_k if breakaway_ratios else 1.2
    return mu_k, min(max(ratio, 1.02), 2.0)


def mass_from_momentum(position: Channel, force: Channel) -> float:
    """About what a driven part weighs [kg]: what its momentum in slip gains from the impulse of the drive."""
    time = position.time_s
    speed = smoothed_velocity(time, position.values)
    impulse = _impulse(time, np.interp(time, force.time_s, force.values))
    rows, right = [], []
    for part, sense in _slip_intervals(speed):
        columns = np.column_stack([speed[part], sense * time[part]])
        rows.append(columns - columns.mean(axis=0))
        right.append(impulse[part] - impulse[part].mean())
    if not rows:
        return math.nan
    mass = float(np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0][0])
    return mass if mass > 0.0 else math.nan


def _impulse(time: Samples, force: Samples) -> Samples:
    return np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(time))])


def _slip_intervals(speed: Samples) -> list[tuple[IndexArray, float]]:
    """Find the samples of every slip in one direction, and that direction."""
    fast = np.where(np.abs(speed) > SLIPPING_SPEED_SHARE * np.abs(speed).max(), np.sign(speed), 0.0)
    parts = np.split(np.arange(len(speed)), np.flatnonzero(np.diff(fast)) + 1)
    return [(part, float(fast[part[0]])) for part in parts if fast[part[0]] and len(part) >= MIN_SLIP_SAMPLES]
