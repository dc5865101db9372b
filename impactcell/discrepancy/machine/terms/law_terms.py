"""Terms by what a model chose: one of the catalogue, or a law that the catalogue does not have."""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from impactcell.discrepancy.machine.terms.base_model import LawForm, Reach, TermChoice
from impactcell.discrepancy.machine.terms.catalogue import CATALOGUE, MotionState, Term
from impactcell.discrepancy.machine.terms.rival_forms import (
    COVARIATES,
    EQUATIONS,
    FREE_FORMS,
    SMOOTH_FORM,
    VALUES,
)
from impactcell.discrepancy.machine.terms.smooth_waves import WAVES, waves_at
from impactcell.records import Samples

LAW_PREFIX = "law_of_"
"""How the identifier of a law's place begins: `law_of_friction_over_speed`."""
LAW_PLACES = {f"{LAW_PREFIX}{form}": form for form in FREE_FORMS}
"""Places where a law of one covariate may act, by their identifiers, and the free form that stands there."""
SMOOTH_LAW = LAW_PREFIX + SMOOTH_FORM
"""Identifier of a smooth force of velocity and position."""

TERMS_OF_FORMS: Mapping[tuple[str, str], str] = {
    ("friction_over_speed", "1"): "coulomb_friction",
    ("friction_over_speed", "u"): "viscous_friction",
    ("friction_over_speed", "u^2"): "quadratic_drag",
    ("friction_over_load", "u"): "load_dependent_friction",
    ("friction_over_position", "u"): "position_dependent_friction",
    ("force_over_position", "u"): "restoring_force",
    ("force_over_position", "u^3"): "hardening_spring",
    ("force_over_speed", "u"): "directional_viscous_friction",
}
"""Terms of the catalogue by the place and the form of a law that is one of them."""


def law_place(identifier: str) -> str:
    """Say how a law in a place enters the equation of motion."""
    return EQUATIONS[identifier.removeprefix(LAW_PREFIX)]


def listed_term(choice: TermChoice, amplitudes: Sequence[float]) -> str:
    """Give the identifier of the term of the catalogue that a law is; empty where it is none."""
    if choice.law is None:
        return ""
    identifier = TERMS_OF_FORMS.get((LAW_PLACES[choice.identifier], choice.law.name), "")
    gives_energy = identifier and CATALOGUE[identifier].nonnegative and min(amplitudes) < 0.0
    return "" if gives_energy else identifier


def term_of(choice: TermChoice) -> Term:
    """Term that a model chose.

    Raises
    ------
    KeyError
        The catalogue has no such term, and it is no law.
    """
    if choice.reach is not None:
        return _smooth_term(choice.identifier, choice.reach)
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


@lru_cache(maxsize=16)
def _smooth_term(identifier: str, reach: Reach) -> Term:
    return Term(
        identifier,
        EQUATIONS[SMOOTH_FORM],
        "found in the records",
        tuple((f"wave_{number}", "{F}") for number in range(1, WAVES**2 + 1)),
        lambda motion, _: waves_at(motion.position, motion.velocity, reach),
    )
