"""Terms by what a model chose: one of the catalogue, or a law that the catalogue does not have."""

from functools import lru_cache

import numpy as np

from impactcell.discrepancy.machine.base_model import LawForm, TermChoice
from impactcell.discrepancy.machine.rival_forms import COVARIATES, FREE_FORMS, VALUES
from impactcell.discrepancy.machine.terms import CATALOGUE, MotionState, Term
from impactcell.records import Samples

LAW_PREFIX = "law_of_"
"""How the identifier of a law's place begins: `law_of_friction_over_speed`."""
LAW_PLACES = {f"{LAW_PREFIX}{form}": form for form in FREE_FORMS}
"""Places where a law may act, by their identifiers, and the free form that stands there."""


def term_of(choice: TermChoice) -> Term:
    """Term that a model chose.

    Raises
    ------
    KeyError
        The catalogue has no such term, and it is no law.
    """
    if choice.law is None:
        return CATALOGUE[choice.identifier]
    return _law_term(choice.identifier, choice.law)


@lru_cache(maxsize=256)
def _law_term(identifier: str, law: LawForm) -> Term:
    form = LAW_PLACES[identifier]
    covariate = COVARIATES[form]
    value_of = VALUES[covariate]
    many = len(law.terms) > 1
    names = [f"amplitude_{number}" if many else "amplitude" for number in range(1, len(law.terms) + 1)]

    def features(motion: MotionState, _shape: float) -> Samples:
        u = value_of(motion)
        return np.stack([item.values(u, law.reference) for item in law.terms])

    return Term(
        identifier,
        f"{FREE_FORMS[form]} with s(u) = {law.name}, u the {covariate}",
        "found in the records",
        tuple((name, "{F}") for name in names),
        features,
        is_friction=form.startswith("friction"),
    )
