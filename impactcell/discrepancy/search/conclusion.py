"""What is established, and what remains: two statements, kept apart."""

import math
from dataclasses import dataclass

from impactcell.discrepancy.data import MIN_HELD_OUT, MIN_TRAINING
from impactcell.discrepancy.search.acceptance import SelectionResult
from impactcell.discrepancy.search.evidence import ALPHA, ModelEvidence
from impactcell.discrepancy.search.gap_measure import MIN_OPEN_GAP
from impactcell.discrepancy.search.residual_map import ALL
from impactcell.discrepancy.search.validation import Validation

# Verdicts, as `result.json` has them.
NO_GAP, NAMED, TIED, UNKNOWN, UNTESTED = "no_gap", "named", "tied", "unknown", "untested"

MAX_P_REMAINS = 0.05
"""p-value over the whole map up to which a cell of it is told as a place where something remains."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where something remains.

    Attributes
    ----------
    phase : str
    depends_on : tuple of str
        Covariates with which it changes.
    """

    phase: str
    depends_on: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Remaining:
    """What no established effect explains.

    Attributes
    ----------
    explained : bool
        Nothing: the gap is at its floor, and no test finds anything.
    share : float
        Share of the held-out gap that is left.
    where : tuple of Place
    level : float
        What the model leaves beside the sensors' noise [1 = noise floor], RMS of the held-out traces.
    """

    explained: bool
    share: float
    where: tuple[Place, ...]
    level: float


@dataclass(frozen=True, slots=True)
class Conclusion:
    """Outcome of the workflow in words.

    Attributes
    ----------
    verdict : str
        `no_gap`, `named`, `tied`, `unknown` or `untested`.
    established : tuple of str
        Effects that held-out shots confirm, in the order in which they were added.
    ties : dict of str to tuple of str
        For each of them those that these data cannot tell from it.
    unconfirmed : tuple of str
        Effects that would explain the training shots, and that held-out shots do not confirm.
    missing_shots : int
        Shots or blocks that are missing for any test; 0 where there are enough.
    """

    verdict: str
    established: tuple[str, ...]
    ties: dict[str, tuple[str, ...]]
    unconfirmed: tuple[str, ...]
    remaining: Remaining
    missing_shots: int


def missing_shots(training: int, held_out: int) -> int:
    """Count the shots or blocks that are missing for tests, if held-out ones keep their share of all."""
    if training >= MIN_TRAINING and held_out >= MIN_HELD_OUT:
        return 0
    total = training + held_out
    shortest = max(MIN_TRAINING / max(training, 1), MIN_HELD_OUT / max(held_out, 1))
    return max(min(math.ceil(shortest * total), 2 * (MIN_TRAINING + MIN_HELD_OUT)) - total, 1)


def conclude(
    selection: SelectionResult, evidence: ModelEvidence, validation: Validation, missing: int
) -> Conclusion:
    """Conclude from the search and from the held-out shots.

    Parameters
    ----------
    evidence : ModelEvidence
        Against the model with all effects that were established.
    missing : int
        Shots missing for any test.
    """
    established = tuple(validation.of_effects)
    ties = {effect: selection.ties.get(effect, ()) for effect in established}
    is_silent = evidence.p_value > ALPHA
    suffices = selection.is_accepted(evidence.fit) and not selection.remains
    explained = validation.is_at_floor and (is_silent or suffices)
    before, after = validation.gap_before, validation.gap_after
    is_open = not explained and before > MIN_OPEN_GAP
    remaining = Remaining(
        explained and not missing,
        max(after - 1.0, 0.0) / (before - 1.0) if is_open else 0.0,
        () if explained else places(evidence),
        max(validation.held_out.after.trace**2 - 1.0, 0.0) ** 0.5,
    )
    if missing:
        verdict = UNTESTED
    elif established:
        verdict = TIED if any(ties.values()) else NAMED
    else:
        verdict = NO_GAP if explained else UNKNOWN
    unconfirmed = tuple(effect for effect in selection.added if effect not in established)
    return Conclusion(verdict, established, ties, unconfirmed, remaining, missing)


def places(evidence: ModelEvidence) -> tuple[Place, ...]:
    """Phases in which residuals differ from zero or change with a covariate, significantly over the map."""
    chart, adjusted = evidence.map, evidence.map_tests.p_adjusted
    width = len(chart.columns)
    found = []
    for row, phase in enumerate(chart.rows):
        cells = [
            name
            for column, name in enumerate(chart.columns)
            if row * width + column < len(adjusted) and adjusted[row * width + column] <= MAX_P_REMAINS
        ]
        if cells:
            found.append(Place(phase, tuple(name for name in cells if name != ALL)))
    return tuple(found)
