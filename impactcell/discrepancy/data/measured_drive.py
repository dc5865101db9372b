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

from impactcell.discrepancy.data.driven_blocks import NORMAL_MAD, velocity
from impactcell.discrepancy.data.shots import POSITION, Index, Shot
from impactcell.records import Channel, Samples

MOST_SAMPLES = 80
FEWEST_KNOTS, MOST_KNOTS = 60, 160
SIGNAL = 4.0
"""Growth of the apparent noise density, when the window doubles, that only a signal makes."""
RESTING = 0.02
"""Share of a block's largest speed below which the part rests."""
SLIPPING = 0.15
"""Share above which it slips without doubt."""
FEWEST_SLIPPING = 10
LARGEST_KICK = 0.5
"""Error of the speed after a breakaway, over the block's largest speed, at one standard deviation."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A drive, linear between evenly spaced knots, and the density of its noise [N²/Hz, two-sided]."""

    time_s: Samples
    force_n: Samples
    density: float


def reduced(shot: Shot, noise_std_m: float, gravity_m_s2: float, mu_k: float) -> Shot:
    """Return a block with a smooth drive, fewer samples and the whitener of its residuals.

    Parameters
    ----------
    shot : Shot
        As recorded.
    mu_k : float
        About what friction is; only the whitener depends on it.
    """
    time, position = shot.times[POSITION], shot.values[POSITION]
    speed = velocity(time, position)
    drive = smooth(shot.drive[0], shot.drive[1], float(time[-1]))
    step = max(math.ceil(len(time) / MOST_SAMPLES), 1)
    chosen = time[::step]
    mass = shot.covariates["mass"]
    G = carried(drive, np.interp(drive.time_s, time, speed), mass, mu_k * mass * gravity_m_s2)
    seen = np.array([np.interp(chosen, drive.time_s, column) for column in G.T]).T
    R = noise_std_m**2 * np.eye(len(chosen)) + seen @ _covariance(drive) @ seen.T
    whitener = solve_triangular(np.linalg.cholesky(R), np.eye(len(chosen)), lower=True)
    empty = np.empty(0)
    return replace(
        shot,
        times=(empty, chosen, empty),
        values=(empty, position[::step], empty),
        drive=np.vstack([drive.time_s, drive.force_n]),
        whitener=whitener,
    )


def smooth(time: Samples, force: Samples, end: float) -> Drive:
    """Least squares by a function that is linear between knots over 0 to `end`.

    Unlike interpolation it has no bias of the mean: what it misses is orthogonal to every such function.
    """
    apart = float(np.median(np.diff(time)))
    density, window = _noise(force, apart)
    count = int(np.clip(round(end / (2.0 * window)), FEWEST_KNOTS, MOST_KNOTS))
    count = max(min(count, int(end / apart)), 2)
    knots = np.linspace(min(time[0], 0.0), max(end, time[-1]), count + 1)
    place = np.clip((time - knots[0]) / (knots[1] - knots[0]), 0.0, count - 1e-9)
    left = place.astype(int)
    share = place - left
    diagonal = np.bincount(left, (1.0 - share) ** 2, count + 1) + np.bincount(left + 1, share**2, count + 1)
    beside = np.bincount(left, share * (1.0 - share), count + 1)
    right = np.bincount(left, (1.0 - share) * force, count + 1) + np.bincount(
        left + 1, share * force, count + 1
    )
    # A knot without samples, as in a gap, is joined to its neighbours.
    small = 1e-9 * float(diagonal.max())
    banded = np.vstack([np.concatenate([[0.0], beside[:-1] - small]), diagonal + 2.0 * small])
    return Drive(knots, solveh_banded(banded, right), density)


def _noise(force: Samples, apart: float) -> tuple[float, float]:
    """Density of the force's noise, and the window of averages in which the drive begins to show.

    Third differences of averages over windows see no slow drive; doubled windows see coloured noise in full.
    """
    window = 1
    density = math.nan
    while len(force) // window >= 16:
        means = force[: len(force) // window * window].reshape(-1, window).mean(axis=1)
        std = float(np.median(np.abs(np.diff(means, 3)))) * NORMAL_MAD / math.sqrt(20.0)
        now = std**2 * window * apart
        if window > 1 and now > SIGNAL * density:
            break
        density, window = now, 2 * window
    return density, 0.5 * window * apart


def _covariance(drive: Drive) -> Samples:
    """Covariance of the knots of a drive with white noise."""
    count = len(drive.time_s)
    h = float(drive.time_s[1] - drive.time_s[0])
    overlap = np.diag(np.full(count, 2.0 * h / 3.0))
    overlap[0, 0] = overlap[-1, -1] = h / 3.0
    overlap += np.diag(np.full(count - 1, h / 6.0), 1) + np.diag(np.full(count - 1, h / 6.0), -1)
    return np.asarray(drive.density * np.linalg.inv(overlap))


def carried(drive: Drive, speed: Samples, mass: float, friction: float) -> Samples:
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
    moving = np.where(np.abs(speed) > RESTING * largest, np.sign(speed), 0.0)
    force = np.abs(drive.force_n)
    slope = np.abs(np.gradient(drive.force_n, h))
    knot_std = math.sqrt(drive.density / h)
    V, X = np.zeros(count), np.zeros(count)
    made = np.zeros((count, count))
    for k in range(count - 1):
        if moving[k] == 0.0 and moving[k + 1] != 0.0:
            kick = max(force[k] - friction, 0.0) / mass / max(float(slope[k]), 1e-9)
            V[k] += min(kick, LARGEST_KICK * largest / max(knot_std, 1e-12))
        X = X + h * V
        if moving[k] != 0.0 or moving[k + 1] != 0.0:
            V = V.copy()
            X[k] += h * h / 3.0 / mass
            X[k + 1] += h * h / 6.0 / mass
            V[k] += 0.5 * h / mass
            V[k + 1] += 0.5 * h / mass
        if moving[k + 1] == 0.0:
            V = np.zeros(count)
        elif moving[k] * moving[k + 1] < 0.0:
            V = V * max(force[k] - friction, 0.0) / max(force[k] + friction, 1e-12)
        made[k + 1] = X
    return made


def friction(shots: tuple[Shot, ...], gravity_m_s2: float) -> tuple[float, float]:
    """About what mu_k and mu_s / mu_k are, without any model of stick and slip.

    In slip of one direction the impulse of the drive less the momentum grows by mu_k m g a second; mu_s is
    what the drive is worth where the part breaks away.
    """
    found, weights, edges = [], [], []
    for shot in shots:
        time = shot.times[POSITION]
        speed = velocity(time, shot.values[POSITION])
        force = np.interp(time, *shot.drive)
        mass = shot.covariates["mass"]
        lost = _impulse(time, force) / mass - speed
        for part, sense in _slips(speed):
            found.append(np.polyfit(time[part], lost[part], 1)[0] * sense / gravity_m_s2)
            weights.append((time[part[-1]] - time[part[0]]) ** 3)
        resting = np.abs(speed) <= RESTING * np.abs(speed).max()
        leaves = np.flatnonzero(resting[:-1] & ~resting[1:])
        edges += (np.abs(force[leaves]) / (mass * gravity_m_s2)).tolist()
    if not found:
        return 0.15, 1.2
    order = np.argsort(found)
    share = np.cumsum(np.array(weights)[order])
    mu_k = float(np.clip(found[order[np.searchsorted(share, 0.5 * share[-1])]], 0.005, 2.0))
    ratio = float(np.median(edges)) / mu_k if edges else 1.2
    return mu_k, min(max(ratio, 1.02), 2.0)


def weighed(position: Channel, force: Channel) -> float:
    """About what a driven part weighs [kg]: what its momentum in slip gains from the impulse of the drive."""
    time = position.time_s
    speed = velocity(time, position.values)
    impulse = _impulse(time, np.interp(time, force.time_s, force.values))
    rows, right = [], []
    for part, sense in _slips(speed):
        columns = np.column_stack([speed[part], sense * time[part]])
        rows.append(columns - columns.mean(axis=0))
        right.append(impulse[part] - impulse[part].mean())
    if not rows:
        return math.nan
    mass = float(np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0][0])
    return mass if mass > 0.0 else math.nan


def _impulse(time: Samples, force: Samples) -> Samples:
    return np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(time))])


def _slips(speed: Samples) -> list[tuple[Index, float]]:
    """Find the samples of every slip in one direction, and that direction."""
    fast = np.where(np.abs(speed) > SLIPPING * np.abs(speed).max(), np.sign(speed), 0.0)
    parts = np.split(np.arange(len(speed)), np.flatnonzero(np.diff(fast)) + 1)
    return [(part, float(fast[part[0]])) for part in parts if fast[part[0]] and len(part) >= FEWEST_SLIPPING]
