"""What another model means for what a cell has learned by the one before it."""

import hashlib
from dataclasses import replace
from typing import Final

from impactcell.prediction import Model
from impactcell.serialization import pack

REPLACED: Final = "replaces provisional"
"""In that of a model which takes its place: its digest."""


def model_digest(model: Model) -> str:
    """Digest by which a state knows the model that it was learned with."""
    return hashlib.sha256(pack(model)).hexdigest()[:16]


def in_place_of(before: Model, model: Model) -> Model:
    """Model that takes the place of another, and says so where that was provisional.

    What was learned by a provisional model is learned anew: its friction was a guess. So it is where a
    provisional model comes back into service, which says that of itself. Until a cycle has come, a second
    model takes the place of the provisional one as well.
    """
    digest = model_digest(before) if before.is_provisional else before.provenance.get(REPLACED)
    if digest is None or model.is_provisional:
        return model
    return replace(model, provenance={**model.provenance, REPLACED: digest})
