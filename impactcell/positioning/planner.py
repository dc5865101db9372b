"""The tap planner: which velocity and stroke bring the part closer, and when there is none."""

import math
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np

from impactcell.errors import PositioningError
from impactcell.physics import Plant
from impactcell.positioning import belief as beliefs
from impactcell.positioning.belief import Belief
from impactcell.positioning.choice import choose
from impactcell.positioning.learning import learn
from impactcell.positioning.limits import allowed_strokes, largest_force
from impactcell.positioning.response import displacement_of
from impactcell.positioning.spread import COARSE_Z, Z, distribution, plants, scenarios, spread_table
from impactcell.positioning.tap import Tap, Unreachable
from impactcell.positioning.value import AIMS, CostToGo, cost_to_go
from impactcell.records import Samples

SLOWEST_M_S = 0.005
VELOCITIES = 24
STROKES = 60
MULTIPLIER = 0.15  # Lagrange multiplier of the bound on overshoot, times that bound
CAUTION = (1.0, 20.0)  # factors on that multiplier, tried in turn until a tap is within the bound
SAME_MASS = 0.03
STALE = np.array([0.02, 0.04, 0.08, 0.03, 2.0])  # change of the belief after which a table is made anew


class _Part(NamedTuple):
    """What has been worked out for parts of one mass, and the belief it was worked out from."""

    mass_kg: float
    caution: float
    belief: Belief
    table: Samples
    value: CostToGo


@dataclass(slots=True)
class TapPlanner:
    """Chooses taps by the expected number still needed, and learns from each.

    Parameters
    ----------
    tolerance_m : float
        A part within this distance of its target, on either side, is in place.
    max_velocity_m_s, max_stroke_m : float
        Limits of a tap. `max_stroke_m` = inf: the cell has no commanded stroke and its actuator halts
        at loss of contact.
    overshoot_probability : float
        Bound for a whole task, learning included.
    plant : Plant, optional
        Nominal plant; contact within some 10 % and
        friction within a factor of 1.4 of what the cell turns out to be.
    max_force_n : float
        Contact force that no tap may exceed.
    two_sided : bool
        Actuators on both ends: a part that went too far is struck back.

    Raises
    ------
    PositioningError
        For a limit, tolerance or probability that no cell can have.
    """

    tolerance_m: float = 10e-6
    max_velocity_m_s: float = 0.1
    max_stroke_m: float = 1.5e-3
    overshoot_probability: float = 1e-3
    plant: Plant | None = None
    max_force_n: float = math.inf
    two_sided: bool = False
    _belief: Belief = field(init=False, repr=False)
    _gravity: float = field(init=False, repr=False)
    _parts: list[_Part] = field(init=False, repr=False, default_factory=list)

    def __post_init__(self) -> None:
        """Refuse what no cell can have, and start from the nominal plant."""
        for name in ("tolerance_m", "max_velocity_m_s", "max_stroke_m", "max_force_n"):
            if not getattr(self, name) > 0.0:
                raise PositioningError(f"tap planner: {name} must be positive, not {getattr(self, name)}")
        if not 0.0 < self.overshoot_probability < 1.0:
            raise PositioningError(
                f"tap planner: overshoot_probability lies between 0 and 1, not {self.overshoot_probability}"
            )
        plant = self.plant
        if plant is None:
            plant = Plant(stiffness_n_per_m=6.5e5, damping_n_s_per_m=465.0, mu_s=0.25, mu_k=0.19)
        viscous = plant.effects.get("viscous_friction", {}).get("viscous_coefficient_n_s_per_m", 0.0)
        self._gravity = plant.gravity_m_s2
        _ready()
        self._belief = beliefs.prior(
            plant.stiffness_n_per_m, plant.damping_n_s_per_m, plant.mu_s, plant.mu_k, float(np.max(viscous))
        )

    @property
    def belief(self) -> Belief:
        """What has been learned so far; a value, to be kept and given back with `resume`."""
        return self._belief

    def resume(self, belief: Belief) -> None:
        """Go on from a belief kept earlier."""
        self._belief = belief

    @property
    def _halts_at_separation(self) -> bool:
        return math.isinf(self.max_stroke_m)

    @property
    def _velocities(self) -> Samples:
        count = VELOCITIES * (8 if self._halts_at_separation else 1)
        return np.geomspace(min(SLOWEST_M_S, 0.5 * self.max_velocity_m_s), self.max_velocity_m_s, count)

    @property
    def _strokes(self) -> Samples:
        if self._halts_at_separation:
            return np.array([math.inf])
        knee = 0.2 * self.max_stroke_m
        return np.concatenate(
            [
                np.linspace(knee / STROKES, knee, STROKES // 2, endpoint=False),
                np.linspace(knee, self.max_stroke_m, STROKES // 2),
            ]
        )

    def next_tap(self, remaining_m: float, mass_kg: float) -> Tap | Unreachable | None:
        """Choose the next tap of a task; None where the part is in place.

        Parameters
        ----------
        remaining_m : float
            Target minus position along +1; negative when the part lies beyond its target.
        mass_kg : float

        Returns
        -------
        Tap, Unreachable or None

        Raises
        ------
        PositioningError
            For a remaining distance or a mass that is not a number, or a mass that is not positive.
        """
        if not math.isfinite(remaining_m):
            raise PositioningError(f"remaining distance must be a number of metres, not {remaining_m}")
        if not (math.isfinite(mass_kg) and mass_kg > 0.0):
            raise PositioningError(f"mass of the part must be a positive number of kg, not {mass_kg}")
        if abs(remaining_m) <= self.tolerance_m:
            return None
        if remaining_m < 0.0 and not self.two_sided:
            return Unreachable(
                f"the part lies {-remaining_m * 1e3:.3f} mm beyond its target "
                "and this cell cannot push it back"
            )
        distance = abs(remaining_m)
        rows = scenarios(self._belief, Z)
        least = 1.0
        for caution in CAUTION:
            part = self._worked_out(mass_kg, caution)
            if not _furthest(part.table) > 0.0:
                return Unreachable(
                    f"no tap up to {self.max_velocity_m_s} m/s and {self.max_stroke_m * 1e3} mm "
                    f"moves a part of {mass_kg} kg at friction {self._belief.mu_k:.3f}"
                )
            chosen, met = choose(
                distance, part.table, self._velocities, self._strokes, rows, part.value, AIMS,
                tolerance=self.tolerance_m, penalty=self._penalty(caution), bound=self.overshoot_probability,
                part_mass=mass_kg, gravity=self._gravity, caps=self._caps(mass_kg),
            )  # fmt: skip
            if chosen is not None:
                break
            least = min(least, met)
        else:
            return Unreachable(
                f"{distance * 1e6:.1f} µm remain, and every tap for a part of {mass_kg:.3g} kg overshoots "
                f"{self.tolerance_m * 1e6:.3g} µm with a probability above {self.overshoot_probability:.2g} "
                f"(the safest with {least:.2g})"
            )
        moved = np.empty((1, Z.size))
        stroke = np.array([chosen.stroke_m])
        distribution(chosen.velocity_m_s, stroke, rows, Z, mass_kg, self._gravity, moved)
        inside = moved[0, np.abs(Z) <= 3.3]
        return Tap(
            velocity_m_s=chosen.velocity_m_s,
            stroke_m=chosen.stroke_m,
            direction=1 if remaining_m > 0.0 else -1,
            expected_m=float(moved[0, Z.size // 2]),
            lowest_m=float(inside.min()),
            highest_m=float(inside.max()),
            expected_taps=chosen.cost,
            overshoot_probability=chosen.overshoot,
        )

    def observe(self, tap: Tap, moved_m: float, mass_kg: float) -> None:
        """Learn from a tap that moved the part by `moved_m`, positive along the tap.

        Raises
        ------
        PositioningError
            For a displacement or a mass that is not a number.
        """
        if not (math.isfinite(moved_m) and math.isfinite(mass_kg) and mass_kg > 0.0):
            raise PositioningError(f"cannot learn from a displacement of {moved_m} m of {mass_kg} kg")

        def response(states: Samples) -> Samples:
            factor = np.maximum(1.0 + states[:, 5], 0.05)
            return displacement_of(
                tap.velocity_m_s, tap.stroke_m, plants(states[:, :5]), factor, mass_kg, self._gravity
            )

        self._belief = learn(self._belief, response, moved_m)

    def observe_friction(self, mu_k: float, std: float, batch_changed: bool = False) -> None:  # noqa: FBT001, FBT002
        """Take over the tracker's kinetic coefficient; `batch_changed`: friction has just stepped.

        Raises
        ------
        PositioningError
            For a coefficient that is not positive or a deviation that is negative.
        """
        if not (math.isfinite(mu_k) and mu_k > 0.0 and math.isfinite(std) and std >= 0.0):
            raise PositioningError(f"cannot use a friction of {mu_k} +- {std}")
        self._belief = beliefs.told_friction(self._belief, mu_k, std, batch_changed=batch_changed)

    def _penalty(self, caution: float) -> float:
        return MULTIPLIER * caution / self.overshoot_probability

    def _worked_out(self, mass_kg: float, caution: float) -> _Part:
        """Table of taps and cost to go for this mass, made anew where the belief has moved on."""
        for n, part in enumerate(self._parts):
            near = abs(part.mass_kg / mass_kg - 1.0) < SAME_MASS and part.caution == caution
            if near and self._still_holds(part):
                self._parts.append(self._parts.pop(n))
                return part
        table = self._table(self._belief, mass_kg)
        value = CostToGo(1.0, np.ones(1), np.ones(1))
        if _furthest(table) > 0.0:
            later = beliefs.foreseen(self._belief)
            less = (np.diag(self._belief.cov) > 1.2 * np.diag(later.cov)).any()
            ahead = self._table(later, mass_kg) if less else table
            value = cost_to_go(ahead, COARSE_Z, self.tolerance_m, self._penalty(caution))
        part = _Part(mass_kg, caution, self._belief, table, value)
        self._parts.append(part)
        del self._parts[:-64]
        return part

    def _table(self, belief: Belief, mass_kg: float) -> Samples:
        table = spread_table(
            self._velocities, self._strokes, scenarios(belief, COARSE_Z), COARSE_Z, mass_kg, self._gravity
        )
        table[self._strokes > self._caps(mass_kg)[:, None]] = math.nan
        return table

    def _stiffest(self) -> Samples:
        """Plant (k, b, mu_s, mu_k, k_v) that presses hardest, within three standard deviations."""
        worst = self._belief.mean + 3.0 * np.sqrt(np.diag(self._belief.cov))
        plant: Samples = plants(worst[None])[0] * np.array([1.0, 1.0, 1.1, 1.1, 1.0])
        return plant

    def _caps(self, mass_kg: float) -> Samples:
        if math.isinf(self.max_force_n):
            return np.full(self._velocities.size, math.inf)
        return allowed_strokes(self._velocities, self.max_force_n, self._stiffest(), mass_kg, self._gravity)

    def force(self, tap: Tap, mass_kg: float) -> float:
        """Bound on the contact force of a tap (N), for `impactcell.positioning.limits.released`."""
        return largest_force(tap.velocity_m_s, tap.stroke_m, self._stiffest(), mass_kg, self._gravity)

    def _still_holds(self, part: _Part) -> bool:
        moved = np.abs(self._belief.mean - part.belief.mean)
        now, then = np.sqrt(np.diag(self._belief.cov)), np.sqrt(np.diag(part.belief.cov))
        scatter = self._belief.scatter / part.belief.scatter
        return bool(np.all(moved < STALE) and np.all(np.abs(now - then) < STALE) and 0.9 < scatter < 1.1)


def _furthest(table: Samples) -> float:
    return float(np.nanmax(table[:, :, COARSE_Z.size // 2], initial=0.0))


@cache
def _ready() -> None:
    """Compile everything, or load it compiled, once a process: no planning step has to wait for it."""
    belief = beliefs.prior(6.5e5, 465.0, 0.2, 0.15, 0.0)
    velocities, strokes = np.array([0.02, 0.05]), np.array([2e-4, 4e-4])
    table = spread_table(velocities, strokes, scenarios(belief, COARSE_Z), COARSE_Z, 20.0, 9.81)
    value = cost_to_go(table, COARSE_Z, 50e-6, 100.0)
    choose(
        2e-3, table, velocities, strokes, scenarios(belief, Z), value, AIMS, tolerance=50e-6, penalty=100.0,
        bound=0.1, part_mass=20.0, gravity=9.81, caps=np.full(2, math.inf),
    )  # fmt: skip
    plant = plants(belief.mean[None])
    displacement_of(0.02, 2e-4, plant, np.ones(1), 20.0, 9.81)
    largest_force(0.02, 2e-4, plant[0], 20.0, 9.81)
    allowed_strokes(velocities, 100.0, plant[0], 20.0, 9.81)
