"""The source paper's own scheme: modified Euler (Heun) at a fixed step, switching on grid points.

Kept by name for comparison. Stick, slip and contact change only on the grid, so its results carry errors of
the order of the step and are not smooth in the parameters; `impactcell.physics.simulate_tap` has neither
fault.
"""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.errors import NoStopError, PhysicsError
from impactcell.numerics.jit import compiled
from impactcell.physics.plant import Plant, TapInput
from impactcell.records import Samples

LONGEST_S = 20.0
VISCOUS = "viscous_friction"


@dataclass(frozen=True, slots=True, eq=False)
class GridMotion:
    """One tap on a grid.

    Attributes
    ----------
    time_s, force_n, position_m, velocity_m_s : ndarray, shape (steps + 1,)
        The last three along the tap; the force is the contact force.
    sliding_distance_m : float
        From the last grid point in contact to rest; nan without a loss of contact.
    """

    time_s: Samples
    force_n: Samples
    position_m: Samples
    velocity_m_s: Samples
    peak_force_n: float
    displacement_m: float
    sliding_distance_m: float


@compiled
def _contact(k: float, b: float, d: float, rate: float) -> float:
    return k * d + b * max(rate, 0.0) if d > 0.0 else 0.0


@compiled
def _acceleration(
    force: float, velocity: float, static: float, kinetic: float, k_v: float, m: float
) -> float:
    # Equations (1) and (2): the friction force opposes motion, and at rest whatever is applied up to F_S.
    if velocity != 0.0:
        return (force - math.copysign(kinetic, velocity) - k_v * velocity) / m
    if abs(force) < static:
        return 0.0
    return (force - math.copysign(static, force)) / m


@compiled
def _heun(
    k: float,
    b: float,
    static: float,
    kinetic: float,
    k_v: float,
    m: float,
    speed: float,
    stroke: float,
    halts: float,
    h: float,
    table: Samples,
) -> int:
    x, v, y = 0.0, 0.0, 0.0
    running = True
    touched = False
    for i in range(table.shape[0]):
        drive = speed if running else 0.0
        force = _contact(k, b, y - x, drive - v)
        table[i, 0] = i * h
        table[i, 1] = force
        table[i, 2] = x
        table[i, 3] = v
        touched = touched or y > x
        if running and (y >= stroke or (halts != 0.0 and touched and y < x)):
            running = False
        if not running and v == 0.0 and force < static:
            return i + 1
        drive = speed if running else 0.0
        first = _acceleration(_contact(k, b, y - x, drive - v), v, static, kinetic, k_v, m)
        next_y = min(y + h * drive, stroke)
        guess_x, guess_v = x + h * v, v + h * first
        second = _acceleration(
            _contact(k, b, next_y - guess_x, drive - guess_v), guess_v, static, kinetic, k_v, m
        )
        next_v = v + 0.5 * h * (first + second)
        x += 0.5 * h * (v + guess_v)
        # Where even the predictor turns round, the mean of both slopes would keep the part creeping for ever.
        v = 0.0 if v * next_v < 0.0 or v * guess_v < 0.0 else next_v
        y = next_y
    return -1


def simulate_modified_euler(plant: Plant, tap: TapInput, step_s: float) -> GridMotion:
    """One tap of the nominal plant, with viscous friction if it has that effect, by the paper's scheme.

    Raises
    ------
    PhysicsError
        For any other effect: the paper's scheme knows none.
    NoStopError
        Still moving after 20 s and the time of the stroke.
    """
    foreign = sorted(set(plant.effects) - {VISCOUS})
    if foreign:
        raise PhysicsError(f"modified Euler solves equations (1)-(3) only, without {', '.join(foreign)}")
    if not step_s > 0.0:
        raise PhysicsError(f"step_s must be positive, not {step_s}")
    k_v = plant.effects.get(VISCOUS, {}).get("viscous_coefficient_n_s_per_m", 0.0)
    if not isinstance(k_v, (int, float)):
        raise PhysicsError(f"{VISCOUS}: viscous_coefficient_n_s_per_m is one number, not {k_v}")
    weight = tap.mass_kg * plant.gravity_m_s2
    longest = LONGEST_S + (tap.stroke_m / tap.velocity_m_s if math.isfinite(tap.stroke_m) else 0.0)
    steps = 1 << 14
    while True:
        table = np.empty((steps, 4))
        count = _heun(
            plant.stiffness_n_per_m,
            plant.damping_n_s_per_m,
            plant.mu_s * weight,
            plant.mu_k * weight,
            float(k_v),
            tap.mass_kg,
            tap.velocity_m_s,
            tap.stroke_m,
            float(tap.halts_at_separation),
            step_s,
            table,
        )
        if count > 0:
            break
        if steps * step_s > longest:
            raise NoStopError(f"the part was still moving after {longest:g} s; command a stroke")
        steps *= 4
    time, force, position, velocity = np.ascontiguousarray(table[:count].T)
    touching = np.flatnonzero(force > 0.0)
    left = touching.size > 0 and touching[-1] < count - 1
    return GridMotion(
        time_s=time,
        force_n=force,
        position_m=position,
        velocity_m_s=velocity,
        peak_force_n=float(force.max()),
        displacement_m=float(position[-1]),
        sliding_distance_m=float(position[-1] - position[touching[-1]]) if left else math.nan,
    )
