"""Whether an effect can be used at all: it says what it is, and its laws have values."""

import math
import re

import numpy as np

from impactcell.numerics.jit import address
from impactcell.physics.effect import Covariates, Effect, Kind, Parameter, Phase

SUFFIXES = {"m": "_m", "s": "_s", "N": "_n", "rad": "_rad", "1/m": "_per_m", "m/s": "_m_s"}
"""End of a parameter's name for its unit."""


def faults_of_use(effect: Effect) -> list[str]:
    """Say for what an effect cannot be used at all: what it states, and laws that have no value; no more."""
    return [*_statement(effect), *_compilation(effect), *_evaluation(effect)]


def _statement(effect: Effect) -> list[str]:
    between = effect.between is not None
    said = [
        (bool(effect.equation.strip()), "it gives no equation"),
        (bool(effect.reference.strip()), "it gives no reference"),
        (
            bool(effect.phases) and all(isinstance(p, Phase) for p in effect.phases),
            "it names no phase in which it shows",
        ),
        (bool(effect.laws) != between, "it needs either laws or between=, not both"),
        (
            all(low < high and np.isfinite([low, high]).all() for low, high in effect.columns.values()),
            "a column's range has to be two ascending numbers",
        ),
        (effect.kind is not Kind.BETWEEN_SHOTS or between, "what acts between shots needs between="),
        (bool(effect.parameters), "it has no parameter"),
        (
            any(not math.isnan(p.null) for p in effect.parameters),
            "no parameter has a null value at which the effect vanishes",
        ),
    ]
    faults = [fault for holds, fault in said if not holds]
    for p in effect.parameters:
        faults += _parameter(p)
    return faults


def _parameter(p: Parameter) -> list[str]:
    ending = SUFFIXES.get(p.unit, "")
    said = [
        (bool(p.unit), f"{p.name} has no unit; write 1 for none"),
        (bool(re.fullmatch(r"[a-z][a-z0-9_]*", p.name)), f"{p.name!r} is no name in lower case"),
        (p.name.endswith(ending), f"{p.name} is in {p.unit}: its name has to end with {ending}"),
        (p.lower < p.upper, f"{p.name}: lower {p.lower:g} is not below upper {p.upper:g}"),
        (p.lower <= p.typical <= p.upper, f"{p.name}: typical {p.typical:g} is not within its range"),
        (
            math.isnan(p.null) or p.lower <= p.null <= p.upper,
            f"{p.name}: null {p.null:g} is not within its range",
        ),
        (p.typical != p.null, f"{p.name}: its typical value is its null value, at which it does nothing"),
        (math.isfinite(p.typical), f"{p.name}: typical {p.typical:g} is no number that a fit can start at"),
        (
            p.typical > 0.0 or not math.isinf(p.null),
            f"{p.name}: it vanishes at infinity, so its typical {p.typical:g} has to be above 0",
        ),
    ]
    return [fault for holds, fault in said if not holds]


def _compilation(effect: Effect) -> list[str]:
    faults = []
    for kind, law in effect.laws.items():
        try:
            address(law)
        except Exception as error:  # noqa: BLE001 - numba raises anything for what it cannot compile
            lines = [line.strip() for line in str(error).splitlines() if line.strip()]
            told = next(
                (line for line in lines if "error" not in line.lower() or len(lines) == 1),
                lines[0] if lines else "",
            )
            faults.append(f"its law {law.__name__} ({kind.name}) cannot be compiled: {told[:200]}")
    return faults


def _evaluation(effect: Effect) -> list[str]:
    """Evaluate what acts between shots, for three of them in three batches."""
    if effect.between is None:
        return []
    one = np.ones(3)
    known = {name: 0.5 * (low + high) * one for name, (low, high) in effect.columns.items()}
    shots = Covariates(30.0 * one, np.arange(1.0, 4.0), 3.0 * one, np.arange(3.0), one, known)
    values = [np.full((3, 2) if p.per_batch else 3, p.typical) for p in effect.parameters]
    try:
        with np.errstate(all="ignore"):
            factors = effect.between(values, shots)
        np.multiply(np.multiply(factors.mu_s, factors.mu_k), factors.mass)
    except Exception as error:  # noqa: BLE001 - somebody else's code may raise anything
        return [f"its between= cannot be evaluated: {type(error).__name__}: {error}"]
    return []
