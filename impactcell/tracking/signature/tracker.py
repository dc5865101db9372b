"""Friction along one stroke from each capture, and whether this cycle is like the others of its material."""

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from impactcell.features import Fault, Features
from impactcell.records import Evidence, Quality, Samples, Signature
from impactcell.tracking.signature import deviation_test, friction_profile
from impactcell.tracking.signature import reference as references
from impactcell.tracking.signature.reference import Reference

MIN_MATERIAL_CYCLES = 5
"""Cycles of a new material before its cycles are judged."""
MAX_DEVIANT_RUN = 10
"""Deviant cycles in a row that are rather another material."""
SHARE_MEMORY = 50.0
"""Judged cycles over which the share of deviant ones is watched."""
MAX_DEVIANT_SHARE = 0.12
"""Share of deviant cycles that is rather how cycles vary by now: seven at once, or one in eight for long."""


@lru_cache(maxsize=64)
def _grid(length_m: float, points: int) -> Samples:
    grid = np.linspace(0.0, length_m, points)
    grid.flags.writeable = False
    return grid


@dataclass(frozen=True, slots=True)
class SignatureSettings:
    """Grid and design of the signature.

    Attributes
    ----------
    length_m : float
        Distance slid at the last grid point.
    points : int
        Grid points from 0 to `length_m`.
    learned_cycles : int
        Cycles from which a cell learns how its cycles vary before any is judged.
    false_alarm_cycles : float
        Designed mean number of cycles between false alarms.
    """

    length_m: float = 4e-3
    points: int = 33
    learned_cycles: int = 50
    false_alarm_cycles: float = 100_000.0

    @property
    def grid_m(self) -> Samples:
        """Grid points, shape (points,); not to be written to."""
        return _grid(self.length_m, self.points)

    @property
    def settled(self) -> float:
        """Cycles of a material before which its mean is too rough to learn variation from."""
        return max(float(self.learned_cycles // 6), 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class SignatureState:
    """What is kept between cycles; `impactcell.serialization` writes it bit for bit."""

    reference: Reference = field(default_factory=Reference)
    batch_id: str = ""
    deviant_run: int = 0
    deviant_share: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class SignatureResult:
    """Outcome of one capture.

    Attributes
    ----------
    deviation : Evidence or None
        Set if the cycle is deviant.
    judged : bool
        Whether the cycle could be judged at all.
    """

    state: SignatureState
    signature: Signature
    deviation: Evidence | None
    judged: bool


def initial_state(settings: SignatureSettings) -> SignatureState:
    """State before the first capture."""
    return SignatureState(references.initial_state(settings.points + 2))


@dataclass(frozen=True, slots=True)
class CycleConditions:
    """What is known of a cycle beside its capture.

    Attributes
    ----------
    batch_id : str
        Material; another one restarts the reference.
    restart : bool
        The tracker found a batch shift, or a change is expected: restart the reference.
    acceleration : callable, optional
        What the model knows to depend on the speed, see `friction_profile.information`.
    gravity_m_s2 : float
    period_s : float
        Time between cycles.
    """

    batch_id: str = ""
    restart: bool = False
    acceleration: friction_profile.Acceleration | None = None
    gravity_m_s2: float = 9.81
    period_s: float = math.nan


def update(
    settings: SignatureSettings,
    state: SignatureState,
    features: Features,
    conditions: CycleConditions = CycleConditions(),
) -> SignatureResult:
    """Take one cycle into the state."""
    state = _of_material(state, conditions)
    grid, slide = settings.grid_m, features.segment
    if isinstance(slide, Fault):
        nothing = np.full(settings.points, math.nan)
        signature = Signature(grid, nothing, nothing, math.nan, math.nan, math.nan, Quality.BAD, str(slide))
        return SignatureResult(state, signature, None, judged=False)
    information = friction_profile.information(slide, grid, conditions.gravity_m_s2, conditions.acceleration)
    friction, std = friction_profile.friction(information, grid)
    missing = _missing_cycles(settings, state.reference)
    if missing:
        reason = f"the reference is being learned, {missing} more cycle{'s' * (missing != 1)}"
        signature = Signature(grid, friction, std, math.nan, math.nan, math.nan, Quality.UNCERTAIN, reason)
        return SignatureResult(
            update_reference(state, information, settings, None), signature, None, judged=False
        )
    test = deviation_test.test_deviation(state.reference, information, grid)
    is_deviant = test.p_value < 1.0 / settings.false_alarm_cycles
    at_m = test.at_m if is_deviant else math.nan
    limits = deviation_test.limits(test, state.reference.variation.cycles, settings.false_alarm_cycles)
    signature = Signature(grid, friction, std, test.t_squared, test.spe, at_m, Quality.GOOD, "", *limits)
    cycle = features.capture.cycle
    evidence = _evidence(settings, test, cycle, conditions.period_s) if is_deviant else None
    return SignatureResult(
        update_reference(state, information, settings, test), signature, evidence, judged=True
    )


def restart(state: SignatureState) -> SignatureState:
    """Learn the mean anew from the next cycle on; how cycles vary is kept."""
    return replace(state, reference=references.restart(state.reference), deviant_run=0)


def _of_material(state: SignatureState, conditions: CycleConditions) -> SignatureState:
    """Restart the reference where the material is another one, and keep its name."""
    batch_id = conditions.batch_id
    is_other = bool(batch_id and state.batch_id and batch_id != state.batch_id)
    if conditions.restart or is_other:
        state = restart(state)
    return replace(state, batch_id=batch_id) if batch_id and batch_id != state.batch_id else state


def _missing_cycles(settings: SignatureSettings, reference: Reference) -> int:
    """Cycles that are to be learned before one is judged."""
    learned = reference.variation.cycles
    if learned >= settings.learned_cycles and reference.weight >= MIN_MATERIAL_CYCLES:
        return 0
    missing = settings.learned_cycles - learned
    missing += int(max(settings.settled - reference.weight, 0.0)) if missing > 0 else 0
    return max(missing, MIN_MATERIAL_CYCLES - int(reference.weight))


def update_reference(
    state: SignatureState,
    information: friction_profile.SplineInformation,
    settings: SignatureSettings,
    test: deviation_test.DeviationTest | None,
) -> SignatureState:
    """Take a normal cycle into the reference; a long run of deviant ones, or many, start it anew.

    After a run the mean is learned anew. Where many deviate between others that do not, as by velocity since
    friction depends on it, so is how cycles vary.
    """

    def with_cycle(reference: Reference, spe: float | None = None) -> Reference:
        return references.update(reference, information, settings.grid_m, settings.settled, spe)

    if test is None:
        return replace(state, reference=with_cycle(state.reference), deviant_run=0)
    is_deviant = test.p_value < 1.0 / settings.false_alarm_cycles
    share = state.deviant_share + (is_deviant - state.deviant_share) / SHARE_MEMORY
    if not is_deviant:
        spe = test.spe / test.spe_freedom if test.spe_freedom > 0 else None
        return SignatureState(with_cycle(state.reference, spe), state.batch_id, 0, share)
    run = state.deviant_run + 1
    if run >= MAX_DEVIANT_RUN:
        return SignatureState(with_cycle(references.restart(state.reference)), state.batch_id)
    if share > MAX_DEVIANT_SHARE:
        return SignatureState(with_cycle(initial_state(settings).reference), state.batch_id)
    return SignatureState(state.reference, state.batch_id, run, share)


def _evidence(
    settings: SignatureSettings, test: deviation_test.DeviationTest, cycle: int, period_s: float
) -> Evidence:
    """Statistic and threshold as -log10 of p-values."""
    rarity = -math.log10(max(test.p_value, 1e-300))
    cycles = settings.false_alarm_cycles
    days = cycles * period_s / 86_400.0
    return Evidence(rarity, math.log10(cycles), cycle, test.size, test.size_std, cycles, days)
