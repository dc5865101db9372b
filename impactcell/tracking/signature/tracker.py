"""Friction along one stroke from each capture, and whether this cycle is like the others of its material."""

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from impactcell.records import Capture, Evidence, Quality, Samples, Signature
from impactcell.tracking.signature import deviation_test, friction_profile
from impactcell.tracking.signature import reference as references
from impactcell.tracking.signature.reference import Reference
from impactcell.tracking.signature.slide_segment import NoSlideError, extract_segment

MIN_MATERIAL_CYCLES = 5  # cycles of a new material before its cycles are judged
MAX_DEVIANT_RUN = 10  # deviant cycles in a row that are rather another material


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


def update(
    settings: SignatureSettings,
    state: SignatureState,
    capture: Capture,
    *,
    batch_id: str = "",
    restart: bool = False,
    separation_s: float | None = None,
    viscous_per_mass: float = 0.0,
    acceleration: friction_profile.Acceleration | None = None,
    gravity_m_s2: float = 9.81,
    period_s: float = math.nan,
) -> SignatureResult:
    """Take one capture into the state.

    Parameters
    ----------
    batch_id : str
        Material; another one restarts the reference.
    restart : bool
        The tracker found a batch shift: restart the reference.
    separation_s : float or None
        Last loss of contact, if it is known; else it is found in the capture.
    viscous_per_mass : float
        k_v / m of the model, 1/s: one cycle cannot tell it from mu(x).
    acceleration : callable, optional
        What else the model knows to depend on the speed, see `profile.information`.
    period_s : float
        Time between cycles.
    """
    if restart or (batch_id and batch_id != state.batch_id and state.batch_id):
        state = replace(state, reference=references.restart(state.reference), deviant_run=0)
    if batch_id and batch_id != state.batch_id:
        state = replace(state, batch_id=batch_id)
    grid = settings.grid_m
    try:
        slide = extract_segment(capture, separation_s)
    except NoSlideError as error:
        nothing = np.full(settings.points, math.nan)
        signature = Signature(grid, nothing, nothing, math.nan, math.nan, math.nan, Quality.BAD, str(error))
        return SignatureResult(state, signature, None, judged=False)
    seen = friction_profile.information(slide, grid, gravity_m_s2, viscous_per_mass, acceleration)
    friction, std = friction_profile.friction(seen, grid)
    known = state.reference
    if known.variation.cycles < settings.learned_cycles or known.weight < MIN_MATERIAL_CYCLES:
        left = settings.learned_cycles - known.variation.cycles
        left += int(max(settings.settled - known.weight, 0.0)) if left > 0 else 0
        left = max(left, MIN_MATERIAL_CYCLES - int(known.weight))
        reason = f"the reference is being learned, {left} more cycles"
        signature = Signature(grid, friction, std, math.nan, math.nan, math.nan, Quality.UNCERTAIN, reason)
        return SignatureResult(update_reference(state, seen, settings, None), signature, None, judged=False)
    verdict = deviation_test.test_deviation(known, seen, grid)
    limit = 1.0 / settings.false_alarm_cycles
    deviant = verdict.p_value < limit
    signature = Signature(
        grid,
        friction,
        std,
        verdict.t_squared,
        verdict.spe,
        verdict.at_m if deviant else math.nan,
        Quality.GOOD,
    )
    evidence = _evidence(settings, verdict, capture.cycle, period_s) if deviant else None
    return SignatureResult(update_reference(state, seen, settings, verdict), signature, evidence, judged=True)


def update_reference(
    state: SignatureState,
    seen: friction_profile.SplineInformation,
    settings: SignatureSettings,
    verdict: deviation_test.DeviationTest | None,
) -> SignatureState:
    """Take a normal cycle into the reference; a long run of deviant ones starts it anew."""
    if verdict is None:
        fresh = references.update(state.reference, seen, settings.grid_m, settings.settled)
        return SignatureState(fresh, state.batch_id)
    if verdict.p_value < 1.0 / settings.false_alarm_cycles:
        run = state.deviant_run + 1
        if run < MAX_DEVIANT_RUN:
            return SignatureState(state.reference, state.batch_id, run)
        fresh = references.update(
            references.restart(state.reference), seen, settings.grid_m, settings.settled
        )
        return SignatureState(fresh, state.batch_id)
    spe = verdict.spe / verdict.spe_freedom if verdict.spe_freedom > 0 else None
    fresh = references.update(state.reference, seen, settings.grid_m, settings.settled, spe)
    return SignatureState(fresh, state.batch_id)


def _evidence(
    settings: SignatureSettings, verdict: deviation_test.DeviationTest, cycle: int, period_s: float
) -> Evidence:
    """Statistic and threshold as -log10 of p-values."""
    rarity = -math.log10(max(verdict.p_value, 1e-300))
    cycles = settings.false_alarm_cycles
    days = cycles * period_s / 86_400.0
    return Evidence(rarity, math.log10(cycles), cycle, verdict.size, verdict.size_std, cycles, days)
