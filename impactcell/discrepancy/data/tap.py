"""Taps: an actuator at constant velocity pushes the part, and halts after its stroke."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.cell_limits import CellLimits
from impactcell.discrepancy.data.excitation import ExcitationStrategy, Setting
from impactcell.discrepancy.data.phases import FREE_SLIDE, LOADING, PRELOAD, STOP, UNLOADING, Trajectory
from impactcell.discrepancy.data.plant_guesses import contact_by_regression, friction_of_slides
from impactcell.discrepancy.data.prepared_shots import (
    ACTUATOR,
    FORCE,
    POSITION,
    IndexArray,
    PreparedShot,
    ShotSet,
)
from impactcell.discrepancy.data.replicate_groups import ALIKE_VELOCITY
from impactcell.discrepancy.data.unit_checks import PlausibleRatio
from impactcell.features.clipping import is_cut_off
from impactcell.features.contact import MIN_CLIPPED_RUN
from impactcell.records import AT_THE_HALT_S, MM_PER_MIN, Capture, Channel, Samples, since_contact

SPEED_RATIO = PlausibleRatio(
    0.05, 20.0, "the part's speed over the actuator's velocity", "position_m, time_s or velocity_mm_per_min",
    column_of_shot="velocity_mm_per_min", apart=2.0, far=20.0,
)  # fmt: skip
"""The part leaves the actuator at one to two times its velocity, and slows down."""
IMPULSE_RATIO = PlausibleRatio(
    0.02, 50.0, "the impulse of force_n over mass times velocity and friction's impulse", "force_n or mass_kg"
)
"""The impulse of the contact gives the part about m v, and bears friction as long as contact lasts."""
BALANCE_RATIO = PlausibleRatio(
    0.02, 50.0, "the impulse of force_n over mass times the part's speed and friction's impulse",
    "force_n or mass_kg", column_of_shot="mass_kg or force_n", apart=1.3, far=20.0,
)  # fmt: skip
"""The same by the part's own largest speed, which is within a few percent of one plant's whatever is struck:
what tells the mass of a single shot."""
TYPICAL_FRICTION = 0.2
"""Coefficient by which friction's impulse is reckoned: from 0.05, polymer, to 0.8, dry metal, it is within a
factor of four, where a wrong unit makes a thousand."""
CONTACT_SHARE = 0.05
"""Force over its largest from which on there is contact."""
MIDDLE_OF_PATH = (0.25, 0.75)
"""Shares of a part's path between which its speed is taken, however long a record goes on at rest."""
WINDOW = 4
"""A part's largest speed is that over one part in so many of the middle of its path, against noise."""
MIN_SAMPLES = 8
"""Samples of a channel from which on its ratios mean anything."""
RATIOS = (1.15, 1.5)
"""mu_s / mu_k at which fits start, below and above the paper's 1.3."""
FALLBACK_STIFFNESSES = (5e4, 2e5, 6e5, 2e6, 8e6)
"""Contact stiffnesses [N/m] at which fits start where no force was recorded: two decades about 6e5."""
DAMPING_TIME_S = 0.7e-3
"""Damping over stiffness [s] of those starts; the paper's plant has 465 N s/m over 6.5e5 N/m."""
FASTER, SLOWER, HEAVIER = 1.3, 0.7, 1.5
"""Factors of velocity and mass by which a next experiment may leave the range that was covered."""
DWELLS_S = (1.0, 1000.0)
"""Dwells [s] that a next experiment may take, three decades apart."""


class Tap(ExcitationStrategy):
    """The actuator runs at constant velocity from first contact until its stroke, in contact or not."""

    excitation = Excitation.TAP
    free_plant_parameters = ("stiffness_n_per_m", "damping_n_s_per_m", "mu_k", "ratio")
    shot_parameters = ("log_factor",)
    has_contact = True
    has_replicates = True
    floor_is_certain = True

    def predicted_channels(self, capture: Capture) -> tuple[Channel | None, Channel | None, Channel | None]:
        """All of them; of the force no sample at first contact and at the actuator's halt: it jumps there."""
        force = capture.force
        if force is not None:
            since = since_contact(force.time_s)
            time_s, values = force.time_s[since], force.values[since]
            beside_halt = ~(np.abs(time_s - capture.halt_s) < AT_THE_HALT_S)
            force = replace(force, time_s=time_s[beside_halt], values=values[beside_halt])
        return force, capture.position, capture.actuator

    def missing_information(self, shots: Sequence[PreparedShot]) -> list[str]:
        """Channels, directions, velocities, masses and replicates that are not there."""
        masses = [shot.mass_kg for shot in shots if math.isfinite(shot.mass_kg)]
        unstated = len(shots) - len(masses)
        velocities = [shot.velocity_m_s for shot in shots]
        lacks = (
            (
                not _is_recorded(shots, FORCE),
                "No force channel: effects of contact and force sensor are seen in the motion only.",
            ),
            (not _is_recorded(shots, POSITION), "No position channel: effects on the slide are hardly seen."),
            (
                not _is_recorded(shots, ACTUATOR),
                "No actuator channel: droop and ramp of the actuator are hard to tell from damping.",
            ),
            (
                len({shot.direction for shot in shots}) < 2,
                "One direction only: tilt and asymmetry of direction cannot be seen.",
            ),
            (
                max(velocities, default=0.0) <= (1.0 + ALIKE_VELOCITY) * min(velocities, default=0.0),
                "One velocity only: terms that depend on speed are hard to tell apart.",
            ),
            (
                len({round(mass, 9) for mass in masses}) < 2,
                "One mass only: mass and stiffness, tilt and restoring force lose their contrast.",
            ),
            (unstated > 0, f"The mass of {unstated} shots is not stated and is fitted."),
            (
                len({shot.group for shot in shots}) == len(shots),
                "No replicates: the sensors' noise is only a lower bound of the floor, and gap (b) is null.",
            ),
        )
        return [note for is_lacking, note in lacks if is_lacking]

    def unit_ratios(self, shot: PreparedShot, gravity_m_s2: float) -> Mapping[PlausibleRatio, float]:
        """Speed of the part over that of the actuator, impulse over momentum by either speed."""
        time, position = shot.times[POSITION], shot.values[POSITION]
        if len(time) < MIN_SAMPLES:
            return {}
        path = np.abs(position - np.median(position[:MIN_SAMPLES]))
        begin, end = (int(np.argmax(path >= share * path.max())) for share in MIDDLE_OF_PATH)
        duration_s = max(float(time[end] - time[begin]), float(np.median(np.diff(time))))
        ratios = {SPEED_RATIO: float(path[end] - path[begin]) / duration_s / shot.velocity_m_s}
        if len(shot.times[FORCE]) > MIN_SAMPLES and math.isfinite(shot.mass_kg):
            force = np.maximum(shot.values[FORCE], 0.0)
            in_contact = (force > CONTACT_SHARE * force.max()).astype(np.float64)
            impulse, contact_s = (float(np.trapezoid(of, shot.times[FORCE])) for of in (force, in_contact))
            braked_m_s = TYPICAL_FRICTION * gravity_m_s2 * contact_s
            ratios[IMPULSE_RATIO] = impulse / (shot.mass_kg * (shot.velocity_m_s + braked_m_s))
            if not _is_clipped(shot.values[FORCE]):
                largest_m_s = _largest_speed(time, path, max((end - begin) // WINDOW, 1))
                ratios[BALANCE_RATIO] = impulse / (shot.mass_kg * (largest_m_s + braked_m_s))
        return ratios

    def plant_guesses(self, shots: Sequence[PreparedShot], gravity_m_s2: float) -> list[dict[str, float]]:
        """Contact by regression of the force, friction by the curvature of the slides."""
        mu_k = friction_of_slides(shots, gravity_m_s2)
        contact = contact_by_regression(shots)
        contacts = [contact] if contact else [(k, DAMPING_TIME_S * k) for k in FALLBACK_STIFFNESSES]
        return [
            {"stiffness_n_per_m": k, "damping_n_s_per_m": b, "mu_k": mu_k, "ratio": ratio}
            for k, b in contacts
            for ratio in RATIOS
        ]

    def initial_state(self, shot: PreparedShot, share: float) -> tuple[float, float]:
        """None: the part lies at rest where positions count from."""
        del shot, share
        return math.nan, 0.0

    def sample_phases(self, shots: ShotSet, trajectory: Trajectory) -> IndexArray:
        """Preload, loading, unloading, free slide and stop."""
        phase = np.full(shots.values.size, STOP, dtype=np.int64)
        moving = np.abs(trajectory.speed_m_s) > 0.0
        touching = trajectory.actuator_displacement_m - trajectory.part_displacement_m > 0.0
        velocity = np.repeat([shot.velocity_m_s for shot in shots.items], np.diff(shots.bounds))
        closing = velocity > trajectory.speed_m_s
        phase[moving & ~touching] = FREE_SLIDE
        phase[moving & touching & ~closing] = UNLOADING
        phase[moving & touching & closing] = LOADING
        phase[~moving & (trajectory.part_displacement_m <= 1e-12)] = PRELOAD
        return phase

    def settings_within_reach(
        self, shots: Sequence[PreparedShot], masses_kg: Samples, batches: Sequence[str], limits: CellLimits
    ) -> list[Setting]:
        """Velocities, masses, directions, dwells and batches: what was done, and one step beyond it.

        All of them come after the shots that there are. Where the part can be struck from either end, each
        velocity and mass may also be taken half in one direction and half in the other.
        """
        latest = max(shots, key=lambda shot: shot.record)
        typical = sorted(shots, key=lambda shot: (shot.velocity_m_s, shot.record))[len(shots) // 2]
        after = replace(typical, batch=latest.batch, record=latest.records, group=-1)
        velocities = sorted({shot.velocity_m_s for shot in shots})
        directions = sorted({shot.direction for shot in shots} | ({1, -1} if limits.both_ends else set()))
        wanted = (velocities[0] * SLOWER, velocities[0], velocities[-1], velocities[-1] * FASTER)
        settings: list[Setting] = []
        for velocity in dict.fromkeys(min(one, limits.max_velocity_m_s) for one in wanted):
            for mass in dict.fromkeys(_masses(shots, masses_kg, limits)):
                at = replace(after, velocity_m_s=velocity, mass_kg=mass)
                each = tuple(replace(at, direction=direction) for direction in reversed(directions))
                words = f"{velocity / MM_PER_MIN:.0f} mm/min, {mass:.3g} kg"
                ways: list[Setting] = [(f"{words}, direction {one.direction:+d}", (one,)) for one in each]
                if len(each) > 1:
                    ways.append((f"{words}, half of them in each direction", each))
                settings += _with_dwells(ways, typical)
        last = max(shot.batch for shot in shots)
        if last:
            settings += [
                (
                    f"batch {batches[batch] or 'without a name'} again, after the others",
                    (replace(after, batch=batch),),
                )
                for batch in range(last + 1)
            ]
        return [(words, tuple(_in_group(one, shots) for one in made)) for words, made in settings]


def _with_dwells(ways: Sequence[Setting], typical: PreparedShot) -> list[Setting]:
    """Add to each way of striking those with a certain rest before, where the shots tell theirs."""
    settings: list[Setting] = []
    for words, made in ways:
        settings.append((words, made))
        if math.isfinite(typical.dwell_s):
            settings += [
                (f"{words}, after {dwell:g} s at rest", tuple(replace(one, dwell_s=dwell) for one in made))
                for dwell in DWELLS_S
            ]
    return settings


def _in_group(shot: PreparedShot, shots: Sequence[PreparedShot]) -> PreparedShot:
    """Put a shot into the replicate group that has its settings, or into one that no other shot is in."""
    alike = (
        one.group
        for one in shots
        if math.isclose(one.velocity_m_s, shot.velocity_m_s)
        and (math.isclose(one.mass_kg, shot.mass_kg) or not math.isfinite(one.mass_kg))
        and one.direction == shot.direction
    )
    return replace(
        shot, group=next(alike, max(one.group for one in shots) + (2 if shot.direction > 0 else 1))
    )


def _masses(shots: Sequence[PreparedShot], masses_kg: Samples, limits: CellLimits) -> tuple[float, ...]:
    """Lightest and heaviest part there was, and a heavier one unless the cell has its part."""
    stated = sorted({shot.mass_kg for shot in shots if math.isfinite(shot.mass_kg)})
    given = math.isfinite(limits.mass_kg)
    known = stated or [limits.mass_kg if given else float(np.median(masses_kg))]
    return (known[0], known[-1]) if given else (known[0], known[-1], known[-1] * HEAVIER)


def _largest_speed(time: Samples, path: Samples, window: int) -> float:
    """Largest speed over so many sampling steps [m/s]."""
    return float(np.max((path[window:] - path[:-window]) / (time[window:] - time[:-window])))


def _is_clipped(force: Samples) -> bool:
    """Whether a force lacks the impulse above the end of its range."""
    below = np.flatnonzero(np.concatenate([[True], force < force.max(), [True]]))
    plateau = int(np.diff(below).max()) - 1
    return plateau >= MIN_CLIPPED_RUN and is_cut_off(force, plateau)


def _is_recorded(shots: Sequence[PreparedShot], channel: int) -> bool:
    return any(len(shot.times[channel]) for shot in shots)
