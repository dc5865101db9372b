"""What the investigation that a model comes from has established, and which of its numbers nothing tells."""

from dataclasses import dataclass
from typing import Final

from impactcell.prediction import REMAINS, Model, Prior
from impactcell.prediction.told_parameters import parameters_in_words, untold

VERDICTS: Final = {
    "no_gap": "nothing is missing in it",
    "named": "what was missing is named",
    "tied": "of what was missing, the data do not tell some names apart",
    "unknown": "something is missing, and nothing was established",
    "untested": "nothing could be tested",
}
"""What a verdict says, as the provenance of a model has it."""
CAUTIONS: Final = {
    "unknown": "nothing was established: what is missing in this model may bend what it says of friction; "
    "to know how, look at the report beside it",
    "untested": "nothing was established: there were too few shots, or too much noise, to tell whether "
    "something is missing in this model; the report beside it says what to record",
}
"""Verdicts beside which a model goes into service with a caution."""


@dataclass(frozen=True, slots=True)
class ModelOrigin:
    """Verdict of the investigation that a model comes from, what of it is told, and a caution or none."""

    verdict: str
    sentence: str
    caution: str


def origin_of(model: Model) -> ModelOrigin | None:
    """Say what was established as a model was found; None where it is of no investigation."""
    said = model.provenance
    verdict = said.get("verdict")
    if verdict is None:
        return None
    gaps = [said.get(f"held-out gap {when}") for when in ("before", "after")]
    parts = [f"verdict of the investigation it comes from: {verdict}"]
    if verdict in VERDICTS:
        parts.append(f" ({VERDICTS[verdict]})")
    if all(gaps):
        parts.append(f"; held-out gap {gaps[0]} noise floors before, {gaps[1]} after")
    caution = CAUTIONS.get(verdict, "")
    if not caution and REMAINS in said:
        caution = (
            f"something remains that no established effect explains: {said[REMAINS]}; it may bend what this "
            "model says of friction, and the report beside it shows where"
        )
    return ModelOrigin(verdict, "".join(parts), caution)


def untold_sentence(model: Model, before: Prior) -> str:
    """Say which parameters nothing tells and what would; empty where none is known worse than before."""
    names = untold(model, before)
    if not names:
        return ""
    return (
        f"what it was found in does not tell {parameters_in_words(model, names)}, and "
        "with such a prior each tap is fitted as if nothing were known; record taps over more velocities, "
        "slow ones too, which stick first, or give the law that its report proposes, `impactcell discrepancy "
        "CAMPAIGN --effects LAW.py -o DIR`; until then the model in service stays"
    )
