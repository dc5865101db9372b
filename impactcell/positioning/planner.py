"""The tap planner: which velocity and stroke bring the part closer, and when there is none."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from impactcell.numerics.raster import ANY_VALUE, Raster
from impactcell.physics import Plant, free_motion
from impactcell.positioning import model_hypotheses
from impactcell.positioning import planner_questions as questions
from impactcell.positioning.cautious_selection import choose_action, least_step_m
from impactcell.positioning.compiling import compile_planning
from impactcell.positioning.displacement_band import displacement_band, tap_of
from impactcell.positioning.displacement_quantiles import parameter_scenarios
from impactcell.positioning.friction_along_stroke import StrokeFriction, update_stroke_friction
from impactcell.positioning.learning import posterior_after
from impactcell.positioning.lookahead_table import (
    LookaheadTable,
    PlannerLimits,
    build_lookahead,
    stiffest,
)
from impactcell.positioning.model_hypotheses import tap_predictions, with_model_accepted
from impactcell.positioning.nominal_plant import nominal_plant
from impactcell.positioning.planner_knowledge import knowledge_of
from impactcell.positioning.planner_posterior import PlannerPosterior
from impactcell.positioning.prediction_watch import POSITION_NOISE_M
from impactcell.positioning.quadrature import Z
from impactcell.positioning.safety_limits import PLANNED_SHARE, largest_force, room_m
from impactcell.positioning.stated_limits import check_sides
from impactcell.positioning.tap import Tap, Unreachable
from impactcell.positioning.without_tap import MOST_STILL, overshooting, stuck, too_light, unmoved
from impactcell.records import Quality, Samples, Signature, TapPredictions

REMEMBERED = 64  # tables, of parts of different mass


@dataclass(slots=True)
class TapPlanner:
    """Chooses taps by the expected number still needed, and learns from each.

    Tolerance, limits, rasters and travel may be changed between two taps, and hold from the next one on;
    `plant` is where the planner starts from, and is asked no more.

    Parameters
    ----------
    tolerance_m : float
        A part within this distance of its target, on either side, is in place.
    max_velocity_m_s, max_stroke_m : float
        Limits of a tap. `max_stroke_m` = inf: the cell has no commanded stroke and its actuator halts
        at loss of contact.
    overshoot_probability : float
        Bound for a whole task, learning included.
    plant : Plant or mapping, optional
        Nominal plant, or those of its fields by name that differ from `nominal_plant.NOMINAL`; contact within
        some 10 % and friction within a factor of 1.4 of what the cell turns out to be. Of its effects,
        resistance that grows with speed is planned with.
    max_force_n : float
        Contact force that no tap may exceed.
    two_sided : bool
        Actuators on both ends: a part that went too far is struck back.
    velocity_raster, stroke_raster : Raster
        Velocities (m/s) and strokes (m) that can be commanded; no other tap is planned.
    travel_m : tuple of float
        Positions between which the part stays, along +1: none is chosen whose 99.9 % band ends beyond.
    position_noise_m : float
        Standard deviation with which a displacement is measured: of a sensor with steps half a step, of one
        whose readings scatter the square root of 2 times what they do.

    Raises
    ------
    PositioningError
        For a limit, tolerance or probability that no cell can have, or a plant that cannot be planned with.
    """

    tolerance_m: float = 10e-6
    max_velocity_m_s: float = 0.1
    max_stroke_m: float = 1.5e-3
    overshoot_probability: float = 1e-3
    plant: Plant | Mapping[str, float] | None = None
    max_force_n: float = math.inf
    two_sided: bool = False
    velocity_raster: Raster = ANY_VALUE
    stroke_raster: Raster = ANY_VALUE
    travel_m: tuple[float, float] = (-math.inf, math.inf)
    position_noise_m: float = POSITION_NOISE_M
    _posterior: PlannerPosterior = field(init=False, repr=False)
    _gravity: float = field(init=False, repr=False)
    _lightest_kg: float = field(init=False, repr=False)
    _limits: PlannerLimits = field(init=False, repr=False)
    _profile: StrokeFriction | None = field(init=False, repr=False, default=None)
    _lookaheads: list[LookaheadTable] = field(init=False, repr=False, default_factory=list)
    _asked_m: float = field(init=False, repr=False, default=math.nan)
    _still: int = field(init=False, repr=False, default=0)

    def __post_init__(self) -> None:
        """Refuse what no cell can have, and start from the nominal plant."""
        self._limits = self._stated_limits()
        plant = nominal_plant(self.plant)
        viscous = max(free_motion.linear_resistance(plant), 0.0)
        self._gravity = plant.gravity_m_s2
        self._lightest_kg = questions.lightest_kg(plant.stiffness_n_per_m, plant.damping_n_s_per_m + viscous)
        questions.check_sensor(self.position_noise_m)
        compile_planning()
        self._posterior = model_hypotheses.prior(
            plant.stiffness_n_per_m, plant.damping_n_s_per_m, plant.mu_s, plant.mu_k, viscous
        )

    @property
    def posterior(self) -> PlannerPosterior:
        """What has been learned so far; a value, to be kept and given back with `resume`."""
        return self._posterior

    def resume(self, posterior: PlannerPosterior) -> None:
        """Go on from what had been learned earlier; taps in a row that moved nothing are counted anew.

        Raises
        ------
        PositioningError
            For anything but a posterior.
        """
        questions.check_posterior(posterior)
        self._posterior = posterior

    def accept_model(self) -> None:
        """Go on with a model that has been extended: what it lacked before is not told again."""
        self._posterior = with_model_accepted(self._posterior)

    @property
    def predictions(self) -> TapPredictions:
        """What the taps so far say of the model: `lacking` where, beyond chance, it lacks something."""
        return tap_predictions(self._posterior)

    def next_tap(
        self, remaining_m: float, mass_kg: float, position_m: float = 0.0
    ) -> Tap | Unreachable | None:
        """Choose the next tap of a task; None where the part is in place.

        Parameters
        ----------
        remaining_m : float
            Target minus position along +1; negative when the part lies beyond its target.
        mass_kg : float
        position_m : float
            Where the part lies along +1, m; what the model lacks may depend on it.

        Returns
        -------
        Tap, Unreachable or None

        Raises
        ------
        PositioningError
            For a distance, mass or position that no part has, as in mm: a target further outside the travel
            than that is long, or 1 m away where none is stated; for limits changed to what no cell can have.
        """
        self._take_limits()
        questions.check_question(remaining_m, mass_kg, position_m, self.travel_m)
        if abs(remaining_m) <= self.tolerance_m:
            return None
        if remaining_m < 0.0 and not self.two_sided:
            return Unreachable(
                f"the part lies {-remaining_m * 1e3:.3f} mm beyond its target "
                "and this cell cannot push it back"
            )
        distance = abs(remaining_m)
        if self._is_stuck(remaining_m):
            return stuck(distance, self.overshoot_probability)
        if mass_kg < self._lightest_kg:
            return too_light(mass_kg, self._lightest_kg)
        part = self._part(mass_kg)
        place = np.array([position_m, math.copysign(1.0, remaining_m)])
        room = room_m(self.travel_m, position_m, place[1])
        if distance - room >= self.tolerance_m:
            return Unreachable(f"the target lies {(distance - room) * 1e3:.3f} mm beyond the travel")
        tap = self._choose(distance, part, place)
        if isinstance(tap, Tap) and tap.highest_m > room:
            return self._choose(distance, part, place, room)
        return tap

    def observe(self, tap: Tap, moved_m: float, mass_kg: float) -> None:
        """Learn from a tap that moved the part by `moved_m`, positive along the tap.

        Raises
        ------
        PositioningError
            For what is no tap, or one that no cell makes: above 1 m/s and the limit, above 0.1 m, or from an
            end without an actuator (beyond limits that were lowered it is learned from); for a mass too light
            to plan for; for a displacement against the tap, or far beyond what taps make, as one in mm.
        """
        questions.check_is_made(tap, mass_kg, self.max_velocity_m_s, self._lightest_kg, self.two_sided)
        questions.check_observation(tap, moved_m, mass_kg, self._posterior.mu_k * self._gravity)
        self._still = self._still + 1 if abs(moved_m) < least_step_m(self.position_noise_m) else 0
        self._posterior = posterior_after(
            self._posterior, tap, moved_m, self._part(mass_kg), self.position_noise_m
        )

    def observe_friction(self, mu_k: float, std: float, batch_changed: bool = False) -> None:  # noqa: FBT001, FBT002
        """Take over the tracker's kinetic coefficient; `batch_changed`: friction has just stepped.

        Raises
        ------
        PositioningError
            For a coefficient that is not positive, a negative deviation, or either as no surface has it.
        """
        questions.check_friction(mu_k, std)
        self._posterior = model_hypotheses.condition_on_friction(
            self._posterior, mu_k, std, batch_changed=batch_changed
        )

    def observe_signature(self, signature: Signature) -> None:
        """Take over how friction varies along the slide; a signature of bad quality says nothing.

        Raises
        ------
        PositioningError
            For what is no signature, or one whose arrays do not belong together.
        """
        questions.check_signature(signature)
        if signature.quality is not Quality.BAD:
            self._profile = update_stroke_friction(
                self._profile, signature.position_m, signature.friction, signature.friction_std
            )

    def force(self, tap: Tap, mass_kg: float) -> float:
        """Bound on the contact force of a tap (N), for `impactcell.positioning.safety_limits.check_tap`.

        Raises `PositioningError` for what is no tap, or no mass.
        """
        questions.check_is_tap(tap)
        questions.check_mass(mass_kg)
        place = np.array([tap.position_m, float(tap.direction)])
        plant = stiffest(self._posterior, self._part(mass_kg), place)
        return largest_force(tap.velocity_m_s, tap.stroke_m, plant, mass_kg, self._gravity)

    def _choose(
        self, distance: float, part: Samples, place: Samples, room: float = math.inf
    ) -> Tap | Unreachable:
        """Choose a tap whose band ends within the room (m) that the travel leaves; inf: any tap."""
        lookahead = self._lookahead(part, place)
        if not lookahead.furthest_m > 0.0:
            return unmoved(self._limits, self._posterior, part, place)
        space = self._limits.space(self._posterior, part, place, lookahead.strokes)
        scenarios = parameter_scenarios(self._posterior, Z, part, place)

        def stays(velocity: float, strokes: Samples) -> NDArray[np.bool_]:
            band = displacement_band(self._posterior, velocity, strokes, part, place)
            within: NDArray[np.bool_] = band.max(axis=1) <= PLANNED_SHARE * room
            return within

        # What is in place ends with the travel: the middle of what is left of it is aimed at.
        cut = 0.5 * max(distance + self.tolerance_m - room, 0.0)
        limits = replace(self._limits, tolerance_m=self.tolerance_m - cut)
        action, least = choose_action(
            distance - cut, lookahead, limits, space, scenarios, None if math.isinf(room) else stays
        )
        if action is None and lookahead.furthest_m < (least_m := least_step_m(self.position_noise_m)):
            return unmoved(self._limits, self._posterior, part, place, least_m)
        if action is None:
            return overshooting(self._limits, distance, part, least, room)
        return tap_of(action, self._posterior, part, place)

    def _stated_limits(self) -> PlannerLimits:
        check_sides(self.two_sided, self.travel_m)
        return PlannerLimits(
            self.tolerance_m, self.max_velocity_m_s, self.max_stroke_m, self.max_force_n,
            self.overshoot_probability, self.velocity_raster, self.stroke_raster,
        )  # fmt: skip

    def _take_limits(self) -> None:
        """Plan within the limits as they are now; tables of taps within others are dropped."""
        before, self._limits = self._limits, self._stated_limits()
        if self._limits.commandable != before.commandable:
            self._lookaheads = []

    def _is_stuck(self, remaining_m: float) -> bool:
        """Whether too many taps in a row have left the part where it lies; who asks again begins anew."""
        is_same = abs(remaining_m - self._asked_m) < least_step_m(self.position_noise_m)
        is_stuck = is_same and self._still >= MOST_STILL
        self._asked_m, self._still = remaining_m, 0 if is_stuck or not is_same else self._still
        return is_stuck

    def _part(self, mass_kg: float) -> Samples:
        return np.concatenate(
            [[mass_kg, self._gravity], [] if self._profile is None else self._profile.warp()]
        )

    def _lookahead(self, part: Samples, place: Samples) -> LookaheadTable:
        """Outlook for this part, made anew where the posterior has moved on."""
        knowledge = knowledge_of(self._posterior)
        alike = (n for n, known in enumerate(self._lookaheads) if known.concerns(part))
        lookahead = self._lookaheads.pop(n) if (n := next(alike, None)) is not None else None
        if lookahead is None or not lookahead.serves(knowledge, place):
            lookahead = build_lookahead(self._limits, self._posterior, part, place, lookahead)
        self._lookaheads = [*self._lookaheads[1 - REMEMBERED :], lookahead]
        return lookahead
