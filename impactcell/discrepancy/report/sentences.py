"""The outcome in two sentences: what is established, and what remains."""

import math

from impactcell.discrepancy.search import NO_GAP, UNTESTED, Remaining, Validation
from impactcell.discrepancy.workflow import DiscrepancyResult


def phrase(identifier: str) -> str:
    """Name of an effect as one would say it."""
    return identifier.replace("_", " ")


def headline(result: DiscrepancyResult) -> str:
    """Say what is established, and what remains."""
    proof, conclusion = result.validation, result.conclusion
    if conclusion.verdict == UNTESTED:
        unit = result.prepared.excitation.unit
        counts = f"{len(result.training)} to fit and {len(result.held_out)} held out"
        return (
            f"Too few {unit} to say: {counts}, about "
            f"{conclusion.missing_shots} more are needed. The held-out gap of the nominal model is "
            f"{_gap(proof)} noise floors."
        )
    if conclusion.verdict == NO_GAP:
        return f"The nominal model explains these shots: the held-out gap is {_gap(proof)} noise floors."
    if not conclusion.established:
        said = f"No known effect explains a held-out gap of {_gap(proof)} noise floors"
        if result.validation.is_at_floor:
            said = (
                "No known effect explains what the training shots show and held-out ones do not: their gap "
                f"is {_gap(proof)} noise floors"
            )
        if conclusion.unconfirmed:
            names = " and ".join(map(phrase, conclusion.unconfirmed))
            said = (
                f"{names.capitalize()} would explain the training shots, but held-out shots do not confirm "
                f"it: their gap is {_gap(proof)} noise floors"
            )
        return f"{said}{_where(result)}."
    groups = [
        " or ".join(map(phrase, (effect, *conclusion.ties.get(effect, ()))))
        for effect in conclusion.established
    ]
    is_tied = any(conclusion.ties.values())
    missing = (
        f"{', and '.join(groups)}, which these shots cannot tell apart" if is_tied else " and ".join(groups)
    )
    fall = f"the held-out gap falls from {proof.gap_before:.2f} to {proof.gap_after:.2f} noise floors"
    established = f"Missing: {missing}; {'' if is_tied else 'with it '}{fall}."
    return established if conclusion.remaining.explained else f"{established} {_left(conclusion.remaining)}"


def _gap(proof: Validation) -> str:
    return f"{proof.gap_before:.2f}"


def _where(result: DiscrepancyResult) -> str:
    if result.unexplained is not None:
        return f", largest in phase {phrase(result.unexplained.phase)}"
    return ""


def _left(remaining: Remaining) -> str:
    places = " and ".join(phrase(place.phase) for place in remaining.where)
    where = f", in {places}" if places else ""
    if math.isclose(remaining.share, 0.0):
        return f"Something remains that it does not explain{where}."
    return f"It leaves {100.0 * remaining.share:.0f} % of the gap{where}."
