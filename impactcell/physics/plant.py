"""What is struck and how: the plant and its effects, and one tap as commanded."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from impactcell.errors import PhysicsError
from impactcell.numerics.stated_numbers import one_number


@dataclass(frozen=True, slots=True)
class Plant:
    """A part on a surface and the contact through which it is struck.

    The nominal model is that of "Real-Time System Identification for Impact-Based Part Positioning",
    equations (1)-(3): m x'' = k d + b max(d', 0) - F(x'), d = y - x, while in contact; Coulomb friction
    F = mu_k m g sign(x') in slip, and up to mu_s m g in stick.

    Parameters
    ----------
    stiffness_n_per_m, damping_n_s_per_m : float
        k and b of the contact; the damper acts in compression only.
    mu_s, mu_k : float
        Static and kinetic coefficient of friction.
    gravity_m_s2 : float
    effects : mapping
        Identifier of each effect present, and its parameters by name (`impactcell.physics.effects`).
        A strength that is left out has the value at which its effect vanishes; what has none, as a period,
        a reach or a Stribeck velocity, its typical one.
    """

    stiffness_n_per_m: float
    damping_n_s_per_m: float
    mu_s: float
    mu_k: float
    gravity_m_s2: float = 9.81
    effects: Mapping[str, Mapping[str, float | Sequence[float]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse a plant that no part can have."""
        for name in ("stiffness_n_per_m", "damping_n_s_per_m", "mu_s", "mu_k", "gravity_m_s2"):
            one_number(f"plant: {name}", getattr(self, name), PhysicsError)
        for name in ("stiffness_n_per_m", "gravity_m_s2"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise PhysicsError(f"plant: {name} must be positive, not {getattr(self, name)}")
        for name in ("damping_n_s_per_m", "mu_s", "mu_k"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise PhysicsError(f"plant: {name} must be 0 or more, not {getattr(self, name)}")
        if not isinstance(self.effects, Mapping):
            raise PhysicsError(
                "plant: effects is to be a mapping from each effect to its parameters by name, "
                f"{{'viscous_friction': {{}}}} say, not {self.effects!r}"
            )
        for identifier, parameters in self.effects.items():
            if not isinstance(parameters, Mapping):
                raise PhysicsError(
                    f"plant: {identifier} is to have its parameters by name, {{}} where none is given, "
                    f"not {parameters!r}"
                )


@dataclass(frozen=True, slots=True)
class TapInput:
    """One tap as commanded: constant velocity from first contact at t = 0 until the stroke is used up.

    Parameters
    ----------
    velocity_m_s, mass_kg : float
    stroke_m : float
        Travel after which the actuator halts at once, in contact or not; inf if it never does.
    direction : int
        +1 or -1, the axis along which the tap acts.
    halts_at_separation : bool
        The actuator halts at the first loss of contact: a cell without a commanded stroke.
    start_m : float
        Position on the table at which the part lies.
    dwell_s : float
        Time at rest before the tap; nan where it is not known.
    shot, shots : int
        Number of this shot, from 1, and how many there are, in file order.
    batch : int
        Number of the batch in order of appearance, 0 for the reference.
    columns : tuple of (str, float)
        What else is known of the shot, by the name of its column of `shots.csv`.
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
    columns: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        """Refuse a tap that cannot be commanded."""
        for name in ("velocity_m_s", "mass_kg"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise PhysicsError(f"tap: {name} must be positive, not {getattr(self, name)}")
        if not self.stroke_m > 0.0:
            raise PhysicsError(f"tap: stroke_m must be positive, not {self.stroke_m}")
        if not math.isfinite(self.start_m):
            raise PhysicsError(f"tap: start_m must be a number, not {self.start_m}")
        if self.direction not in {1, -1}:
            raise PhysicsError(f"tap: direction must be 1 or -1, not {self.direction}")
