"""The forces of one shot with every effect folded in, as functions of the state of one phase.

Within a phase (stick or slip, contact or gap, closing or opening, driven or halted) every law is smooth
and is continued smoothly beyond the phase's end, so that an integrator may step across and look back.

State vector: advance of the part along the shot, its velocity, advance of the actuator, then the
states of the effects. Advances are 0 at first contact and positive along the shot's direction.
"""

import enum
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulator.effects import Effect, Parameter, Shot, build

Samples = NDArray[np.float64]


class Contact(enum.Enum):
    """Where the actuator is with respect to the part."""

    TOUCHING = "touching"
    NEAR = "near"
    APART = "apart"


@dataclass(frozen=True, slots=True)
class Plant:
    """A part on a surface and the actuator that taps it; equations (1)-(3) of the paper.

    m x'' = k d + b max(d', 0) - F in contact, d = y - x; F = mu_k m g against the motion, and up to
    mu_s m g at rest. Friction that grows with speed is the effect `viscous_friction`.
    """

    stiffness_n_per_m: float
    damping_n_s_per_m: float
    mu_s: float
    mu_k: float
    gravity_m_s2: float = 9.81
    effects: Mapping[str, Mapping[str, Parameter]] = field(default_factory=dict)


@dataclass(slots=True)
class Phase:
    """Which of the smooth laws is in force.

    Attributes
    ----------
    slip : int
        Direction of sliding along the shot; 0 in stick.
    anchor : float
        Where elastic stick holds on.
    closing : bool
        The indentation grows, so that the damper acts.
    halted : bool
        The actuator stands.
    """

    slip: int
    contact: Contact
    closing: bool
    halted: bool
    anchor: float = 0.0

    def copy(self) -> "Phase":
        """Return the same phase as a value of its own."""
        return Phase(self.slip, self.contact, self.closing, self.halted, self.anchor)


def _overriding(effects: Sequence[Effect], name: str) -> list[Any]:
    """Methods of those effects that say something about `name`."""
    return [
        getattr(effect, name)
        for effect in effects
        if getattr(type(effect), name) is not getattr(Effect, name)
    ]


class Forces:
    """Forces on part and actuator during one shot."""

    def __init__(
        self,
        plant: Plant,
        shot: Shot,
        mass_kg: float,
        velocity_m_s: float = 0.0,
        drive: Callable[[float], float] | None = None,
    ) -> None:
        effects = build(plant.effects)
        self.effects = effects
        self.shot = shot
        self.sign = shot.direction
        self.start = shot.start_m
        self.mass = mass_kg
        for effect in effects:
            self.mass = effect.mass(self.mass)
        self.weight = self.mass * plant.gravity_m_s2
        self.mass -= sum(effect.detached_mass() for effect in effects)
        whole = math.prod(effect.shot_factor(shot) for effect in effects)
        self.mu_k = plant.mu_k * whole
        self.mu_s = plant.mu_s * whole * math.prod(effect.static_factor(shot) for effect in effects)
        self.stiffness = plant.stiffness_n_per_m
        self.damping = plant.damping_n_s_per_m
        self.velocity = velocity_m_s
        self.drive = drive
        self.slope_force = self.weight * sum(effect.weight_fraction() for effect in effects)
        self.presliding = sum(effect.presliding_stiffness() for effect in effects)
        self.compliance = sum(effect.compliance() for effect in effects)
        self.pull_range = max((effect.pull_range() for effect in effects), default=0.0)
        self._factor = _overriding(effects, "friction_factor")
        self._increase = _overriding(effects, "kinetic_increase")
        self._body = _overriding(effects, "body_force")
        self._spring = _overriding(effects, "spring_force")
        self._contact_damping = _overriding(effects, "contact_damping")
        self._contact_force = _overriding(effects, "contact_force")
        self._pull = _overriding(effects, "pull")
        self._speed = _overriding(effects, "actuator_speed")
        self._sensed = _overriding(sorted(effects, key=lambda entry: entry.sensor_stage), "sensed")
        place = 3
        self._states: list[tuple[Effect, int, int]] = []
        for effect in effects:
            if effect.absolute_tolerance:
                self._states.append((effect, place, place + len(effect.absolute_tolerance)))
                place += len(effect.absolute_tolerance)
        acting = ("spring_force", "contact_damping", "contact_force", "state_contact_force", "pull")
        driving = ("actuator_speed", "speed_loss", "compliance")
        self._plain_contact = not any(_overriding(effects, name) for name in acting + driving)
        self._loss = self._with_states("speed_loss")
        self._state_force = self._with_states("state_force")
        self._state_contact_force = self._with_states("state_contact_force")

    def _with_states(self, name: str) -> list[tuple[Any, int, int]]:
        return [(law, a, b) for effect, a, b in self._states for law in _overriding([effect], name)]

    @property
    def absolute_tolerance(self) -> list[float]:
        """Integration tolerance of each entry of the state vector."""
        own = [tolerance for effect, _, _ in self._states for tolerance in effect.absolute_tolerance]
        return [1e-13, 1e-12, 1e-13, *own]

    @property
    def ongoing(self) -> bool:
        """Something moves on although the part is at rest."""
        return self.drive is not None or any(effect.ongoing for effect in self.effects)

    def initial(self, velocity: float) -> list[float]:
        """State at time 0, the part moving at `velocity` along the shot."""
        own = [
            value
            for effect, _, _ in self._states
            for value in effect.initial(self.start, self.sign * velocity)
        ]
        return [0.0, velocity, 0.0, *own]

    def kinks(self) -> list[float]:
        """Return the times at which a law changes its form."""
        return sorted({time for effect in self.effects for time in effect.kinks()})

    def actuator_free_speed(self, phase: Phase, t: float, z: Sequence[float]) -> float:
        """Speed of the actuator but for what it loses at once under load."""
        if phase.halted:
            return 0.0
        speed = self.velocity
        for law in self._speed:
            speed = law(t, self.velocity, speed)
        for loss, first, last in self._loss:
            speed -= loss(z[first:last])
        return speed

    def contact(self, phase: Phase, t: float, z: Sequence[float]) -> tuple[float, float]:
        """Contact force and speed of the actuator."""
        free = self.actuator_free_speed(phase, t, z)
        d = z[2] - z[0]
        if phase.contact is Contact.APART:
            return 0.0, free
        if phase.contact is Contact.NEAR:
            force = 0.0
            for pull in self._pull:
                force -= pull(-d)
            return force, free if phase.halted else free - self.compliance * force
        spring = self.stiffness * d
        for law in self._spring:
            spring = law(d, self.stiffness, spring)
        damping = self.damping if phase.closing else 0.0
        for damper in self._contact_damping:
            damping += damper(d)
        rate = free - z[1]
        compliance = 0.0 if phase.halted else self.compliance
        # With a drive that gives way at once the force stands on both sides of d' = free - compliance F - x'.
        force = (spring + damping * rate) / (1.0 + damping * compliance)
        for further in self._contact_force:
            force += further(d, rate, t)
        for state_law, first, last in self._state_contact_force:
            force += state_law(d, z[first:last])
        # Never negative; but a step that crosses the loss of contact has to find the law it came with.
        if d >= 0.0:
            force = max(force, 0.0)
        return force, free - compliance * force

    def contact_along(self, phase: Phase, time: Samples, states: Samples) -> Samples:
        """Contact force at many times of one phase; `states` has shape (n, states)."""
        if self._plain_contact and phase.contact is not Contact.NEAR:
            if phase.contact is Contact.APART:
                return np.zeros(len(time))
            force = self.stiffness * np.maximum(states[:, 2] - states[:, 0], 0.0)
            if phase.closing:
                force += self.damping * ((0.0 if phase.halted else self.velocity) - states[:, 1])
            return np.maximum(force, 0.0)
        return np.array(
            [self.contact(phase, t, z)[0] for t, z in zip(time.tolist(), states.tolist(), strict=True)]
        )

    def body(self, t: float, z: Sequence[float]) -> float:
        """All else that acts on the part but dry friction, along the shot."""
        x = self.start + self.sign * z[0]
        v = self.sign * z[1]
        force = self.slope_force
        for law in self._body:
            force += law(x, v, t)
        for state_law, first, last in self._state_force:
            force += state_law(x, v, z[first:last])
        if self.drive is not None:
            force += self.drive(t)
        return self.sign * force

    def _local(self, t: float, advance: float) -> float:
        factor = 1.0
        for law in self._factor:
            factor *= law(self.start + self.sign * advance, t)
        return factor

    def kinetic(self, t: float, advance: float, speed: float) -> float:
        """Kinetic friction, positive."""
        mu = self.mu_k
        for law in self._increase:
            mu += law(speed)
        return mu * self._local(t, advance) * self.weight

    def static(self, t: float, advance: float) -> float:
        """Force up to which the part holds; never less than what would stop it again at once."""
        return max(self.mu_s * self._local(t, advance) * self.weight, self.kinetic(t, advance, 0.0))

    def applied(self, phase: Phase, t: float, z: Sequence[float]) -> float:
        """Force that friction has to withstand in stick."""
        if self.presliding > 0.0:
            return self.presliding * (z[0] - phase.anchor)
        return self.contact(phase, t, z)[0] + self.body(t, z)

    def closing_rate(self, phase: Phase, t: float, z: Sequence[float]) -> float:
        """Rate of the indentation."""
        return self.contact(phase, t, z)[1] - z[1]

    def rates(self, phase: Phase, t: float, z: Sequence[float]) -> list[float]:
        """Right-hand side of the equations of motion."""
        force, speed = self.contact(phase, t, z)
        advance, velocity = z[0], z[1]
        if phase.slip:
            friction = phase.slip * self.kinetic(t, advance, abs(velocity))
            acceleration = (force + self.body(t, z) - friction) / self.mass
        elif self.presliding > 0.0:
            friction = self.presliding * (advance - phase.anchor)
            acceleration = (force + self.body(t, z) - friction) / self.mass
        else:
            velocity = acceleration = 0.0
        out = [velocity, acceleration, speed]
        if self._states:
            x, v = self.start + self.sign * advance, self.sign * velocity
            d = z[2] - advance if phase.contact is Contact.TOUCHING else 0.0
            for effect, first, last in self._states:
                out += effect.rates(x, v, d, force, z[first:last])
        return out

    def sensor_lag(self) -> tuple[int, float] | None:
        """Place in the state vector of the lagging sensor's output, and its time constant."""
        for effect, first, _ in self._states:
            if effect.sensor_time_constant() > 0.0:
                return first, effect.sensor_time_constant()
        return None

    def sensed(self, force: float) -> float:
        """Return what the force channel shows for a force that has passed its lag."""
        for sensed in self._sensed:
            force = sensed(force)
        return force

    def sensed_along(self, force: Samples) -> Samples:
        """Return what the force channel shows, sample by sample."""
        return np.array([self.sensed(value) for value in force.tolist()]) if self._sensed else force

    @property
    def delay(self) -> float:
        """By how much force is recorded late."""
        return sum(effect.delay() for effect in self.effects)
