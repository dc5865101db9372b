"""One simulated tap: from first contact to rest, with its traces."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactcell.api.stated_tap import check_fastest, check_sample_times
from impactcell.errors import PhysicsError
from impactcell.numerics.stated_numbers import numbers, one_number
from impactcell.physics import Plant, TapInput
from impactcell.physics import simulate_tap as integrate_tap
from impactcell.records import Samples

REFERENCE_PLANT: Mapping[str, float] = {"stiffness_n_per_m": 6.5e5, "damping_n_s_per_m": 465.0, "mu_s": 0.2}
"""k in N/m and b in N s/m with which equations (1)-(3) give back the paper's printed equations (4) and (5)
(own fit, with `RATIO` and k_v = 85 N s/m); mu_s of steel on carbide in the middle of the paper's range."""
RATIO = 0.76
"""mu_k / mu_s of the same fit, taken where mu_k is not given."""
RATE_HZ = 10_000.0
"""Sampling rate of the traces where no times are given; that of the paper's sensors."""

REST_S = 0.02
"""How long the traces go on after the part has come to rest, s: an estimator has to see that it rests."""


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedTap:
    """One tap from first contact at time 0 to rest, all along the tap.

    Attributes
    ----------
    time_s, force_n, position_m, velocity_m_s, actuator_m : ndarray, shape (n,)
        The traces: contact force, positive in compression; position and velocity of the part; position of
        the actuator.
    peak_force_n : float
        Maximum of the contact force over all contacts.
    sliding_distance_m : float
        From the last loss of contact to rest; nan if the part never moved or never left the actuator.
    displacement_m : float
        From first contact to rest.
    breakaway_s, separation_s, stop_s : float
        When the part first moved, last left the actuator, and came to rest; nan where it did not.
    """

    time_s: Samples
    force_n: Samples
    position_m: Samples
    velocity_m_s: Samples
    actuator_m: Samples
    peak_force_n: float
    sliding_distance_m: float
    displacement_m: float
    breakaway_s: float
    separation_s: float
    stop_s: float


def simulate_tap(
    velocity_m_s: float,
    mass_kg: float,
    stroke_m: float = math.inf,
    *,
    plant: Plant | Mapping[str, Any] | None = None,
    time_s: ArrayLike | Sequence[float] | None = None,
) -> SimulatedTap:
    """Simulate one tap by equations (1)-(3) and any effects beside them.

    m x'' = k d + b max(d', 0) - F(x'), d = y - x, while in contact; Coulomb friction F = mu_k m g sign(x')
    in slip, up to mu_s m g in stick ("Real-Time System Identification for Impact-Based Part Positioning").
    Integrated from event to event: contact, breakaway, separation and stop are located inside the steps.

    Parameters
    ----------
    velocity_m_s, mass_kg : float
        Constant velocity of the actuator, and mass of the part.
    stroke_m : float
        Travel from first contact after which the actuator halts; inf if it halts as it loses contact.
    plant : Plant or mapping, optional
        `impactcell.physics.Plant`, or those of its fields that differ from the reference plant:
        `stiffness_n_per_m`, `damping_n_s_per_m`, `mu_s`, `mu_k` (0.76 mu_s if not given), `gravity_m_s2`,
        `effects` (identifier of each effect, and its parameters by name).
    time_s : array_like, shape (n,), optional
        Times of the samples; 10 kHz until the part has been at rest for 20 ms if not given.

    Returns
    -------
    SimulatedTap

    Raises
    ------
    PhysicsError
        A mass, velocity, time, field or effect that cannot be, what is no number, or a part that never comes
        to rest.

    Examples
    --------
    >>> tap = simulate_tap(0.075, 18.9)
    >>> f"{tap.peak_force_n:.0f} N, {1e6 * tap.sliding_distance_m:.0f} um"
    '266 N, 6744 um'
    """
    velocity = one_number("velocity_m_s", velocity_m_s, PhysicsError)
    mass = one_number("mass_kg", mass_kg, PhysicsError)
    stroke = one_number("stroke_m", stroke_m, PhysicsError)
    check_fastest(velocity, PhysicsError)
    stated = None if time_s is None else np.atleast_1d(numbers("time_s", time_s, PhysicsError))
    if stated is not None:
        check_sample_times(stated)
    motion = integrate_tap(
        _plant(plant), TapInput(velocity, mass, stroke, halts_at_separation=math.isinf(stroke))
    )
    until_s = motion.stop_s + REST_S
    times = np.arange(math.ceil(until_s * RATE_HZ) + 1) / RATE_HZ if stated is None else stated
    traces = motion.sample(times)
    left = motion.first_breakaway_s <= motion.last_separation_s
    return SimulatedTap(
        time_s=times,
        force_n=traces.force_n,
        position_m=traces.position_m,
        velocity_m_s=traces.velocity_m_s,
        actuator_m=traces.actuator_m,
        peak_force_n=motion.peak_force_n,
        sliding_distance_m=motion.distance_after_separation_m if left else math.nan,
        displacement_m=motion.displacement_m,
        breakaway_s=motion.first_breakaway_s,
        separation_s=motion.last_separation_s,
        stop_s=motion.stop_s,
    )


def _plant(given: Plant | Mapping[str, Any] | None) -> Plant:
    if isinstance(given, Plant):
        return given
    if given is not None and not isinstance(given, Mapping):
        raise PhysicsError(f"plant is a Plant, or some of its fields by name, not {given!r}")
    fields: dict[str, Any] = {**REFERENCE_PLANT, **(given or {})}
    unknown = [name for name in fields if name not in Plant.__dataclass_fields__]
    if unknown:
        raise PhysicsError(
            f"plant: no field {unknown[0]!r}; there are {', '.join(Plant.__dataclass_fields__)}"
        )
    if "mu_k" not in fields:
        fields["mu_k"] = RATIO * one_number("plant: mu_s", fields["mu_s"], PhysicsError)
    return Plant(**fields)
