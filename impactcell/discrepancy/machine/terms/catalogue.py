"""Terms that a machine's model may have: each a generalised force, linear in its strengths.

A term with `is_friction` acts against the motion: its feature is the level of friction per unit of strength,
and -s times it is the force, with s the direction of motion, between -1 and +1 where the part turns.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from impactcell.records import Samples


@dataclass(frozen=True, slots=True, eq=False)
class MotionState:
    """State of a machine at n samples, each of shape (n,).

    Attributes
    ----------
    position, velocity : ndarray
        [m, m/s] or [rad, rad/s].
    load : ndarray
        |F + G sin(q - q_0)|: what gear or guide carries (`carried_load`) [N or N m].
    covariate : ndarray
        Value of the term's column of `shots.csv`.
    """

    position: Samples
    velocity: Samples
    load: Samples
    covariate: Samples


@dataclass(frozen=True, slots=True)
class TermShape:
    """A parameter in which a term is not linear.

    Attributes
    ----------
    name : str
    covariate : str
        `speed` or `position`: the range of its grid follows from what was gone through.
    shares : tuple of float
        Its grid, in shares of the largest speed or of the range of positions.
    """

    name: str
    covariate: str
    shares: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Term:
    """A term by its law.

    Attributes
    ----------
    identifier : str
    equation : str
    reference : str
    strengths : tuple of (str, str)
        Name and unit of each; `{F}` stands for N or N m, `{q}` for m or rad.
    features : callable
        `features(motion, shape)`: force, or level of friction, per unit of each strength: (strengths, n).
    is_friction : bool
        It acts against the motion.
    needs_covariate : bool
        It is a law of a column of `shots.csv`.
    shape : TermShape or None
    nonnegative : bool
        A negative strength would give energy.
    has_memory : bool
        It follows from the whole path, so that it is known only where the position is the input.
    """

    identifier: str
    equation: str
    reference: str
    strengths: tuple[tuple[str, str], ...]
    features: Callable[[MotionState, float], Samples]
    is_friction: bool = False
    needs_covariate: bool = False
    shape: TermShape | None = None
    nonnegative: bool = False
    has_memory: bool = False


SPEED_SHARES = (0.005, 0.007, 0.01, 0.014, 0.02, 0.028, 0.04, 0.056, 0.08, 0.11, 0.15, 0.21, 0.3)
"""Stribeck velocities over the largest speed: slower than a tenth of it as a rule, and never all of it."""
LENGTH_SHARES = (0.001, 0.002, 0.003, 0.005, 0.007, 0.01, 0.015, 0.02, 0.03, 0.05, 0.07, 0.1)
"""Presliding lengths over the range of positions: microns to a tenth of the stroke."""
PERIOD_SHARES = tuple(2.0 / halves for halves in range(3, 49))
"""Periods over the range of positions: one and a half to 24 in it, half of one apart, for a wave that is
one period off over the range looks like nothing."""

CATALOGUE: dict[str, Term] = {
    term.identifier: term
    for term in (
        Term(
            "coulomb_friction",
            "-F_c sign(q')",
            "Coulomb 1785",
            (("friction", "{F}"),),
            lambda motion, _: np.ones((1, motion.velocity.size)),
            is_friction=True,
            nonnegative=True,
        ),
        Term(
            "viscous_friction",
            "-k_v q'",
            "Stokes 1851",
            (("viscous_coefficient", "{F} s/{q}"),),
            lambda motion, _: -motion.velocity[None],
            nonnegative=True,
        ),
        Term(
            "quadratic_drag",
            "-c q' |q'|",
            "Rayleigh 1876",
            (("drag_coefficient", "{F} s²/{q}²"),),
            lambda motion, _: -(motion.velocity * np.abs(motion.velocity))[None],
            nonnegative=True,
        ),
        Term(
            "directional_viscous_friction",
            "-k_v (1 + a sign(q')) q', the part that differs: -k_a |q'|",
            "Armstrong-Hélouvry 1991",
            (("asymmetric_coefficient", "{F} s/{q}"),),
            lambda motion, _: -np.abs(motion.velocity)[None],
        ),
        Term(
            "stribeck_friction",
            "-dF exp(-(q'/v_s)²) sign(q')",
            "Stribeck 1902; Bo and Pavelescu 1982",
            (("friction_increase", "{F}"),),
            lambda motion, velocity: np.exp(-((motion.velocity / velocity) ** 2))[None],
            is_friction=True,
            shape=TermShape("stribeck_velocity", "speed", SPEED_SHARES),
            nonnegative=True,
        ),
        Term(
            "load_dependent_friction",
            "-c |F + G sin(q - q_0)| sign(q')",
            "Duclusaud et al. 2024, arXiv 2410.08650",
            (("load_coefficient", "1"),),
            lambda motion, _: motion.load[None],
            is_friction=True,
            nonnegative=True,
        ),
        Term(
            "covariate_friction",
            "-c u sign(q'), u a column of shots.csv",
            "Coulomb 1785, normal force by u",
            (("friction_per_covariate", "{F}/u"),),
            lambda motion, _: motion.covariate[None],
            is_friction=True,
            needs_covariate=True,
        ),
        Term(
            "covariate_force",
            "A u, u a column of shots.csv",
            "force by pressure or current",
            (("force_per_covariate", "{F}/u"),),
            lambda motion, _: motion.covariate[None],
            needs_covariate=True,
        ),
        Term(
            "position_dependent_friction",
            "-g q sign(q')",
            "linear in the place",
            (("friction_gradient", "{F}/{q}"),),
            lambda motion, _: motion.position[None],
            is_friction=True,
        ),
        Term(
            "periodic_friction",
            "-(a sin(2 pi q/p) + b cos(2 pi q/p)) sign(q')",
            "periodic in the place",
            (("sine_amplitude", "{F}"), ("cosine_amplitude", "{F}")),
            lambda motion, period: _waves(motion.position, period),
            is_friction=True,
            shape=TermShape("period", "position", PERIOD_SHARES),
        ),
        Term(
            "periodic_force",
            "a sin(2 pi q/p) + b cos(2 pi q/p)",
            "cogging of a motor or gear",
            (("sine_amplitude", "{F}"), ("cosine_amplitude", "{F}")),
            lambda motion, period: _waves(motion.position, period),
            shape=TermShape("period", "position", PERIOD_SHARES),
        ),
        Term(
            "restoring_force",
            "-k_r q",
            "Hooke 1678",
            (("stiffness", "{F}/{q}"),),
            lambda motion, _: -motion.position[None],
        ),
        Term(
            "hardening_spring",
            "-k_3 q³",
            "Duffing 1918",
            (("cubic_stiffness", "{F}/{q}³"),),
            lambda motion, _: -(motion.position**3)[None],
        ),
        Term(
            "presliding_hysteresis",
            "-F_h (z - sign(q')), z' = q' (1 - z sign(q')) / l",
            "Dahl 1968",
            (("friction", "{F}"),),
            lambda motion, length: _direction(motion.velocity) - _dahl_state(motion.position, length)[None],
            shape=TermShape("presliding_length", "position", LENGTH_SHARES),
            nonnegative=True,
            has_memory=True,
        ),
    )
}
"""Terms by their identifier."""


def _waves(position: Samples, period: float) -> Samples:
    angle = 2.0 * np.pi * position / period
    return np.stack([np.sin(angle), np.cos(angle)])


def _direction(velocity: Samples) -> Samples:
    return np.sign(velocity)


def _dahl_state(position: Samples, length: float) -> Samples:
    """State z of Dahl's model along a path, exact from sample to sample, shape (n,)."""
    decay = np.exp(-np.abs(np.diff(position)) / length)
    sense = np.sign(np.diff(position))
    state = np.empty(position.size)
    state[0] = z = 0.0
    for place, (share, sign) in enumerate(zip(decay.tolist(), sense.tolist(), strict=True), 1):
        if sign:
            z = sign + (z - sign) * share
        state[place] = z
    return state
