"""What to measure next where no two effects have to be told apart, in no language yet."""

import enum
import math
from collections import Counter
from typing import NamedTuple

from impactcell.discrepancy.search import UNTESTED
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.physics import Kind, Phase
from impactcell.physics.effects import find_effect

NOT_SET = frozenset({"direction", "order"})
"""Covariates of which there are no more values to set: a shot goes one way or the other, and has its turn."""
ENOUGH_OF_A_DIRECTION = 0.35
"""Share of the taps from which on those of a direction are enough: 8 of 40 left a tilt unconfirmed that 16
named [1]. Own choice."""


class Step(enum.Enum):
    """Kinds of a next step."""

    MORE_SHOTS = "more shots at settings like these"
    MASS = "the mass of the part"
    REPLICATES = "settings again, for how far friction scatters"
    OTHER_DIRECTION = "shots in a direction of which there are none"
    NOTHING = "nothing more"
    PLACE = "settings again, for where something remains"
    MORE_OF_DIRECTION = "shots in a direction of which there are few"
    BATCHES = "a batch for each mass"
    VALUES = "more values of covariates"
    SAME = "the same settings again"


class NextStep(NamedTuple):
    """What to measure.

    Attributes
    ----------
    shots : int
        How many; 0 where it is not a matter of their number.
    direction : int
        In which they go, 0 where both will do.
    covariates : tuple of str
        To be varied.
    phase : str
        In which something remains; empty where nothing does, or nobody knows where.
    """

    step: Step
    shots: int = 0
    direction: int = 0
    covariates: tuple[str, ...] = ()
    phase: str = ""


def plan_next_step(result: DiscrepancyResult) -> NextStep:
    """Decide what to measure where no two effects have to be told apart."""
    conclusion = result.conclusion
    if conclusion.verdict == UNTESTED:
        return NextStep(Step.MORE_SHOTS, conclusion.missing_shots)
    if result.per_kilogram:
        return NextStep(Step.MASS)
    if lacks_replicates(result):
        return NextStep(Step.REPLICATES)
    scarce, count = _scarce_direction(result)
    if conclusion.remaining.explained:
        is_unseen = scarce != 0 and scarce not in {shot.direction for shot in result.prepared.shots}
        return NextStep(Step.OTHER_DIRECTION, count, scarce) if is_unseen else NextStep(Step.NOTHING)
    place = result.unexplained or next(iter(conclusion.remaining.where), None)
    if place is None:
        return NextStep(Step.PLACE)
    if scarce and "direction" in place.depends_on:
        return NextStep(Step.MORE_OF_DIRECTION, count, scarce, phase=place.phase)
    acts_between = place.phase == Phase.BETWEEN_SHOTS.value
    if acts_between and "mass" in place.depends_on and len(result.prepared.batches) < 2:
        return NextStep(Step.BATCHES, phase=place.phase)
    varied = tuple(name for name in place.depends_on if name not in NOT_SET)
    return NextStep(Step.VALUES if varied else Step.SAME, covariates=varied, phase=place.phase)


def lacks_replicates(result: DiscrepancyResult) -> bool:
    """Whether no setting was repeated, and what is not confirmed acts between shots."""
    unconfirmed = result.conclusion.unconfirmed
    acts_between = [find_effect(name).kind is Kind.BETWEEN_SHOTS for name in unconfirmed]
    return math.isnan(result.replicates.spread) and bool(unconfirmed) and all(acts_between)


def _scarce_direction(result: DiscrepancyResult) -> tuple[int, int]:
    """Direction of which taps are few, and how many more are enough; (0, 0) where they are."""
    if not result.prepared.excitation.has_contact:
        return 0, 0
    counts = Counter(shot.direction for shot in result.prepared.shots)
    scarce = min((1, -1), key=lambda direction: counts[direction])
    enough = math.ceil(ENOUGH_OF_A_DIRECTION / (1.0 - ENOUGH_OF_A_DIRECTION) * counts[-scarce])
    return (scarce, enough - counts[scarce]) if counts[scarce] < enough else (0, 0)
