"""The simulator's own plant: one tap, one free slide, or a driven part, exact to about 1e-9.

Written apart from `impactcell.physics`, so that a test which compares the two says something.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from simulator.effects import Shot
from simulator.plant_forces import Contact, Forces, Phase, Plant
from simulator.plant_integrator import Event, NeverAtRestError, Path, Piece, integrate
from simulator.position_lag import lag_behind

__all__ = [
    "Event",
    "Motion",
    "NeverAtRestError",
    "Plant",
    "Shot",
    "TapInput",
    "simulate_driven",
    "simulate_free_slide",
    "simulate_tap",
]

Samples = NDArray[np.float64]
REFINEMENTS = 8


@dataclass(frozen=True, slots=True)
class TapInput:
    """One tap as commanded.

    Attributes
    ----------
    velocity_m_s, mass_kg, stroke_m : float
        The actuator runs at this velocity from first contact until the stroke is used up, then halts.
    halts_at_separation : bool
        The actuator halts when it first loses the part, whatever its stroke.
    """

    velocity_m_s: float
    mass_kg: float
    stroke_m: float = math.inf
    direction: int = 1
    halts_at_separation: bool = False
    start_m: float = 0.0
    dwell_s: float = math.nan
    shot: int = 1
    shots: int = 1
    batch: int = 0

    def covariates(self) -> Shot:
        """Return what the effects may know of the shot."""
        return Shot(self.direction, self.start_m, self.dwell_s, self.shot, self.shots, self.batch)


class Motion:
    """What happened in one shot; time 0 is first contact, or the start where there is none.

    Attributes
    ----------
    events : tuple of Event
        In order: breakaway, turn (of the indentation), separation, contact, range (of adhesion), halt, stop.
    displacement_m : float
        From time 0 to rest, positive along the shot.
    sliding_distance_m : float
        From the last loss of contact to rest, positive along the shot; nan without a loss of contact.
    """

    def __init__(self, forces: Forces, path: Path) -> None:
        self._forces = forces
        self._path = path
        self._starts = np.array([piece.start_s for piece in path.pieces])
        self.events = path.events
        self.displacement_m = path.end_state[0]

    def _last(self, kind: str) -> float:
        return next((event.time_s for event in reversed(self.events) if event.kind == kind), math.nan)

    @property
    def breakaway_s(self) -> float:
        """Time at which the part first moves."""
        return next((event.time_s for event in self.events if event.kind == "breakaway"), math.nan)

    @property
    def separation_s(self) -> float:
        """Time of the last loss of contact."""
        return self._last("separation")

    @property
    def stop_s(self) -> float:
        """Time of the last stop."""
        return self._last("stop")

    @property
    def halt_s(self) -> float:
        """Time at which the actuator halts; 0 where it never runs or halts with the loss of contact."""
        halt = self._last("halt")
        return 0.0 if math.isnan(halt) else halt

    @property
    def end_s(self) -> float:
        """Time up to which the motion was followed."""
        return self._path.end_s

    @property
    def mu_s(self) -> float:
        """Static coefficient of this shot, effects between shots included."""
        return self._forces.mu_s

    @property
    def mu_k(self) -> float:
        """Kinetic coefficient of this shot, effects between shots included."""
        return self._forces.mu_k

    @property
    def sliding_distance_m(self) -> float:
        """Distance from the last loss of contact to rest."""
        if math.isnan(self.separation_s):
            return math.nan
        return float(self.displacement_m - self._states(np.array([self.separation_s]))[0, 0])

    @cached_property
    def peak_force_n(self) -> float:
        """Largest contact force over all contacts; the force itself, not what a sensor shows."""
        looks = [
            (force, time, piece)
            for piece in self._path.pieces
            if piece.phase.contact is Contact.TOUCHING
            for time, force in self._looks(piece, piece.start_s, piece.stop_s)
        ]
        if not looks:
            return 0.0
        _, _, best = max(looks, key=lambda look: look[0])
        # The peak may lie a little beyond the end of the piece with the best look: its neighbours count too.
        return max(
            self._refined(piece)
            for piece in self._path.pieces
            if piece.phase.contact is Contact.TOUCHING
            and piece.start_s <= best.stop_s
            and piece.stop_s >= best.start_s
        )

    def _refined(self, piece: Piece) -> float:
        time, best = max(self._looks(piece, piece.start_s, piece.stop_s), key=lambda look: look[1])
        spacing = (piece.stop_s - piece.start_s) / 8.0
        for _ in range(REFINEMENTS):
            # The best of nine looks lies within one spacing of the peak: look closer around it.
            low, high = max(time - spacing, piece.start_s), min(time + spacing, piece.stop_s)
            time, best = max(self._looks(piece, low, high), key=lambda look: look[1])
            spacing /= 4.0
        return best

    def _looks(self, piece: Piece, start: float, stop: float) -> list[tuple[float, float]]:
        times = np.linspace(start, stop, 9)
        forces = self._forces.contact_along(piece.phase, times, piece.states(times).T)
        return list(zip(times.tolist(), forces.tolist(), strict=True))

    def _states(self, time: Samples) -> Samples:
        """State vectors, shape (n, states); the last state after the end."""
        out = np.empty((len(time), len(self._path.end_state)))
        out[:] = self._path.end_state
        for place, chosen in self._groups(time):
            out[chosen] = self._path.pieces[place].states(time[chosen]).T
        return out

    def _groups(self, time: Samples) -> list[tuple[int, NDArray[np.intp]]]:
        places = np.clip(np.searchsorted(self._starts, time, side="right") - 1, 0, None)
        inside = np.flatnonzero(time <= self._path.end_s)
        if not len(inside) or not len(self._starts):
            return []
        order = inside[np.argsort(places[inside], kind="stable")]
        cuts = np.flatnonzero(np.diff(places[order])) + 1
        return [(int(places[group[0]]), group) for group in np.split(order, cuts)]

    def position_m(self, time_s: Samples) -> Samples:
        """Position of the part along +1 from where it lay, as its channel shows it, shape (n,)."""
        advance = self._states(np.maximum(time_s, 0.0))[:, 0]
        lag_s = sum(effect.position_time_constant() for effect in self._forces.effects)
        if lag_s > 0.0:
            advance -= lag_behind(self._path.pieces, lag_s, time_s)
        return self._forces.sign * advance

    def velocity_m_s(self, time_s: Samples) -> Samples:
        """Velocity of the part along +1, shape (n,)."""
        return self._forces.sign * self._states(np.maximum(time_s, 0.0))[:, 1]

    def actuator_m(self, time_s: Samples) -> Samples:
        """Position of the actuator along +1 from first contact, shape (n,)."""
        return self._forces.sign * self._states(np.maximum(time_s, 0.0))[:, 2]

    def contact_force_n(self, time_s: Samples) -> Samples:
        """Contact force itself, shape (n,); zero before first contact."""
        return self._force(time_s, sensor=False)

    def force_n(self, time_s: Samples) -> Samples:
        """Force as its channel shows it without noise, shape (n,)."""
        shown = self._force(time_s - self._forces.delay, sensor=True)
        return self._forces.sensed_along(shown)

    def sensed(self, force: float) -> float:
        """Return what the force channel shows for a steady force."""
        return self._forces.sensed(force)

    @property
    def sensor_lag_s(self) -> float:
        """Time constant of the force channel, 0 where it follows at once."""
        lag = self._forces.sensor_lag()
        return lag[1] if lag is not None else 0.0

    @property
    def sensor_delay_s(self) -> float:
        """By how much force is recorded late."""
        return self._forces.delay

    def _force(self, time: Samples, *, sensor: bool) -> Samples:
        forces, path = self._forces, self._path
        lag = forces.sensor_lag() if sensor else None
        last = forces.contact(path.end_phase, path.end_s, path.end_state)[0]
        out = np.full(len(time), last)
        if lag is not None:
            place, constant = lag
            out += (path.end_state[place] - last) * np.exp(-np.maximum(time - path.end_s, 0.0) / constant)
        for place, chosen in self._groups(time):
            piece = path.pieces[place]
            states = piece.states(time[chosen]).T
            if lag is not None:
                out[chosen] = states[:, lag[0]]
            else:
                out[chosen] = forces.contact_along(piece.phase, time[chosen], states)
        out[time < 0.0] = 0.0
        return out


def simulate_tap(plant: Plant, strike: TapInput) -> Motion:
    """One tap, from first contact until the part is at rest for good.

    Raises
    ------
    ValueError
        A stroke without end with an actuator that never halts: the part would be pushed for ever.
    NeverAtRestError
        Still sliding after 20 s and twice the stroke's time.
    """
    if math.isinf(strike.stroke_m) and not strike.halts_at_separation:
        message = "an actuator without a stroke has to halt at separation"
        raise ValueError(message)
    forces = Forces(plant, strike.covariates(), strike.mass_kg, strike.velocity_m_s)
    phase = Phase(slip=0, contact=Contact.TOUCHING, closing=True, halted=False)
    drive_s = strike.stroke_m / strike.velocity_m_s if math.isfinite(strike.stroke_m) else 0.0
    path = integrate(
        forces,
        phase,
        0.0,
        strike.stroke_m,
        20.0 + 2.0 * drive_s,
        halts_at_separation=strike.halts_at_separation,
    )
    return Motion(forces, path)


def simulate_free_slide(plant: Plant, mass_kg: float, speed_m_s: float, shot: Shot | None = None) -> Motion:
    """Let a part slide from `speed_m_s` along the shot's direction at time 0 until it is at rest."""
    forces = Forces(plant, shot or Shot(), mass_kg)
    phase = Phase(slip=1, contact=Contact.APART, closing=False, halted=True)
    return Motion(forces, integrate(forces, phase, speed_m_s, math.inf, 60.0))


def simulate_driven(
    plant: Plant,
    mass_kg: float,
    force_n: Callable[[float], float],
    duration_s: float,
    shot: Shot | None = None,
) -> Motion:
    """Drive a part from rest by `force_n(t)` along +1 for `duration_s`."""
    forces = Forces(plant, shot or Shot(), mass_kg, drive=force_n)
    phase = Phase(slip=0, contact=Contact.APART, closing=False, halted=True)
    return Motion(forces, integrate(forces, phase, 0.0, math.inf, math.inf, duration_s=duration_s))
