"""`result.json` of an investigation with a base model: the format of the workflow of shots."""

import math
from typing import Any

from impactcell.discrepancy.laws import shape_names
from impactcell.discrepancy.machine import (
    ECCENTRICITY,
    ChosenTerm,
    FallOfGap,
    FittedModel,
    MachineFinding,
    OpenLoopError,
    law_place,
    shape_grid,
    term_of,
)
from impactcell.discrepancy.report.machine_parameters import SYMBOLS, law_covariates, parameter_name
from impactcell.discrepancy.report.machine_sentences import headline, law_equation
from impactcell.discrepancy.report.result import FORMAT, SPLINE_ONLY, experiments, round_digits
from impactcell.discrepancy.report.simulation_notes import notes_of_simulation
from impactcell.discrepancy.search import MIN_OPEN_GAP

ECCENTRIC_PARTS = ("position_eccentricity_cosine", "position_eccentricity_sine")
"""Names of the two amplitudes of an encoder that turns off its centre."""

OPEN_INTERVALS = (
    "The intervals of what is named do not include what remains: with it, values may lie beyond them."
)
"""What is said of intervals where a model leaves something."""


def machine_document(finding: MachineFinding) -> dict[str, Any]:
    """Outcome as `result.json` has it."""
    before, after = finding.simulated
    fall = finding.fall
    nominal = tuple(term for term in finding.final.terms if term.choice.name not in finding.established)
    return {
        "format": FORMAT,
        "verdict": finding.verdict,
        "headline": headline(finding),
        "effects": [
            _effect(finding, term) for term in finding.final.terms if term.choice.name in finding.established
        ],
        "unconfirmed": list(finding.unconfirmed),
        "unconfirmed_since": dict(finding.unconfirmed_since),
        "remaining": _remaining(finding),
        "unexplained": None,
        "gap": {
            "unit": "1 = noise floor",
            "train": {
                "before": round_digits(finding.train_gaps[0]),
                "after": round_digits(finding.train_gaps[1]),
            },
            "held_out": {
                **_fall(fall),
                "closed": round_digits(fall.closed),
                "expected_without_gap": [round_digits(bound) for bound in finding.expected],
            },
        },
        "simulation": _simulation(finding, (before, after)) | {"better_with": _better(finding)},
        **_law(finding),
        "next_experiment": experiments(finding.experiments),
        "nominal": _nuisances(finding.final)
        | {
            name: value
            for term in nominal
            for name, value in _parameters(finding, finding.final, term, in_full=True).items()
        },
        "noise_floor": {
            "noise_std": [
                round_digits(max(record.sensor_noise[channel] for record in finding.records))
                for channel in (1, 0)
            ],
            "channels": ["force", "position"],
        },
        "blocks": {
            "seconds": round_digits(finding.block_s),
            "training": len(finding.training),
            "held_out": len(finding.held_out),
        },
        "notes": [
            *finding.notes,
            *([OPEN_INTERVALS] if finding.established and not finding.is_at_floor else []),
            *notes_of_simulation(finding, (before, after)),
        ],
        "seed": finding.seed,
        "model": "model.extended.yaml",
        "report": "report.html",
    }


def _remaining(finding: MachineFinding) -> dict[str, Any]:
    """Say what remains; at the floor, only how large and how correlated that is."""
    fall, left = finding.fall, finding.remainder
    said = {
        "explained": finding.is_at_floor,
        "share": 0.0,
        "where": [],
        "model_error": {
            "level": round_digits(math.sqrt(max(fall.after**2 - 1.0, 0.0))),
            "unit": "1 = noise floor",
            "correlation_s": round_digits(left.correlation_s),
        },
        "shots": [],
        "share_in_shots": 0.0,
        "share_of_constants": 0.0,
        "hints": [one.name for one in finding.clear_strengths],
    }
    if finding.is_at_floor:
        return said
    is_open = fall.before > MIN_OPEN_GAP
    return said | {
        "share": round_digits(max(fall.after - 1.0, 0.0) / (fall.before - 1.0)) if is_open else 0.0,
        "where": [{"phase": _phase(finding), "depends_on": []}],
        "shots": list(left.shots),
        "share_in_shots": round_digits(left.share),
        "share_of_constants": round_digits(left.constant_share),
    }


def _law(finding: MachineFinding) -> dict[str, Any]:
    """Write what is proposed where something remains; null, with the reason, where nothing is."""
    law = finding.law
    if law is None:
        return {"law": None, "law_refused": finding.law_refused or None}
    units = law_covariates(finding)
    chosen = None if law.choice is None else ChosenTerm(law.choice, 0.0)
    document = {
        "place": law_place(law.place),
        "covariates": [*units],
        "form": SPLINE_ONLY if law.choice is None or law.choice.law is None else law.choice.law.name,
        "equation": law_equation(finding, law),
        "term": law.listed or None,
        "parameters": {} if chosen is None else _law_parameters(finding, chosen),
        "equivalents": list(law.equivalents),
        "rival_places": [law_place(place) for place in law.rival_places],
        "beside": list(law.beside),
        "tested_range": {
            covariate: {"low": round_digits(low), "high": round_digits(high), "unit": units[covariate]}
            for covariate, (low, high) in law.tested.items()
        },
        "held_out": {**_fall(law.fall), "p_value": round_digits(law.fall.p_value)},
        "simulation": None if law.simulated is None else _simulation(finding, law.simulated),
        "file": None if law.choice is None else f"{law.place}.yaml",
        "table": f"{law.place}.csv" if law.choice is None else None,
    }  # fmt: skip
    return {"law": document, "law_refused": None}


def _law_parameters(finding: MachineFinding, chosen: ChosenTerm) -> dict[str, Any]:
    """Amplitudes with their intervals, the shapes that went with the spline, and what powers are over."""
    assert finding.law is not None  # noqa: S101 - asked for a law alone
    assert chosen.choice.law is not None  # noqa: S101
    model, law = finding.law.model, chosen.choice.law
    force, (of_covariate,) = SYMBOLS[finding.base.coordinate]["force"], law_covariates(finding).values()
    document: dict[str, Any] = {}
    for (name, unit), column in zip(term_of(chosen.choice).strengths, chosen.columns, strict=True):
        place = model.fit.columns.index(column)
        told = parameter_name(name, unit, finding.base.coordinate)
        document[told] = _estimate(model, place) | {"unit": force}
    for item in law.terms:
        for atom, values in zip(item.term, item.shapes, strict=True):
            for shape, value in zip(atom.shapes, values, strict=True):
                name = next(name for name in shape_names(shape.name) if name not in document)
                document[name] = _held(value, of_covariate if shape.has_unit else "1")
    return document | ({"reference": _held(law.reference, of_covariate)} if law.has_reference else {})


def _held(value: float, unit: str) -> dict[str, Any]:
    return {"value": round_digits(value), "ci95": None, "at_bound": False, "unit": unit}


def _phase(finding: MachineFinding) -> str:
    return "driven" if any(record.force.any() for record in finding.records) else "free_slide"


def _fall(fall: FallOfGap) -> dict[str, Any]:
    closed = None if math.isnan(fall.closed) else [round_digits(fall.low), round_digits(fall.high)]
    return {"before": round_digits(fall.before), "after": round_digits(fall.after), "closed_ci95": closed}


def _simulation(finding: MachineFinding, errors: tuple[OpenLoopError, OpenLoopError]) -> dict[str, Any]:
    channel = str(finding.base.response)
    when = dict(zip(("before", "after"), errors, strict=True))
    return {
        "channel": channel,
        "unit": finding.base.unit,
        "rmse": {name: round_digits(error.rmse) for name, error in when.items()},
        "fit_percent": {name: round_digits(error.fit_percent) for name, error in when.items()},
        "relative_force_error": {name: round_digits(error.relative_force) for name, error in when.items()},
    }


def _better(finding: MachineFinding) -> dict[str, Any] | None:
    """Terms, any of which blocks do not show, and with which the simulation errs far less."""
    better = finding.better_simulated
    return None if better is None else {"effects": list(better.names), "rmse": round_digits(better.rmse)}


def _effect(finding: MachineFinding, term: ChosenTerm) -> dict[str, Any]:
    name = term.choice.name
    fall = finding.falls[name]
    trials = (step.accepted for step in finding.steps if step.accepted is not None)
    trial = next(trial for trial in trials if trial.term.choice == term.choice)
    document = {
        "effect": term.choice.identifier,
        "tied_with": list(finding.tied_with[name]),
        "p_value": round_digits(fall.p_value),
        "gain_over_its_error": round_digits(trial.z),
        "held_out": _fall(fall),
        "where": {
            "phase": _phase(finding),
            "depends_on": [term.choice.covariate] if term.choice.covariate else [],
        },
        "parameters": _parameters(finding, finding.final, term),
        "tied_parameters": {
            rival: _parameters(finding, model, model.term(rival))
            for rival, model in finding.tied_models.items()
            if rival in finding.tied_with[name]
        },
    }
    return document | ({"covariate": term.choice.covariate} if term.choice.covariate else {})


def _parameters(
    finding: MachineFinding, model: FittedModel, chosen: ChosenTerm, *, in_full: bool = False
) -> dict[str, Any]:
    """Strengths with their intervals, and the shape where there is one; `in_full` names the term too."""
    term, fit = term_of(chosen.choice), model.fit
    prefix = f"{chosen.choice.name}." if in_full else ""
    document: dict[str, Any] = {}
    for (name, unit), column in zip(term.strengths, chosen.columns, strict=True):
        place = fit.columns.index(column)
        document[prefix + parameter_name(name, unit, finding.base.coordinate)] = _estimate(model, place)
    if term.shape is not None:
        per_s = "_per_s" if term.shape.covariate == "speed" else ""
        name = f"{term.shape.name}_{SYMBOLS[finding.base.coordinate]['q']}{per_s}"
        document[prefix + name] = _shape(finding, model, chosen)
    return document


def _shape(finding: MachineFinding, model: FittedModel, chosen: ChosenTerm) -> dict[str, Any]:
    """Shape of a term with its interval; an end that the records do not tell is null."""
    ends = model.shape_intervals.get(chosen.choice.name, (0.0, math.inf))
    grid = shape_grid(term_of(chosen.choice), finding.scale)
    return {
        "value": round_digits(chosen.shape),
        "ci95": [round_digits(end) if 0.0 < end < math.inf else None for end in ends],
        "at_bound": chosen.shape in (grid[0], grid[-1]),
    }


def _nuisances(model: FittedModel) -> dict[str, Any]:
    base, gain = model.base, 1.0 + model.base.force_gain.value
    # What is fitted is a deviation from what is stated: value = stated + unit * coefficient.
    fitted = {
        "force_gain": (base.force_gain.value, gain),
        "force_offset": (base.force_offset.value * (1.0 + model.nuisance("force_gain")), 1.0),
        "position_offset": (base.position_offset.value, 1.0),
        "inertia": (base.inertia.value, base.inertia.value),
        "gravity_torque": (base.gravity_torque.value, 1.0),
        "delay_s": (base.delay_s.value, 1.0),
        ECCENTRICITY: (0.0, 1.0),
    }
    return {
        ECCENTRIC_PARTS[column[2]] if column[0] == ECCENTRICITY else column[0]: _estimate(
            model, place, *fitted[column[0]]
        )
        for place, column in enumerate(model.fit.columns)
        if column[0] in fitted
    }


def _estimate(model: FittedModel, place: int, stated: float = 0.0, unit: float = 1.0) -> dict[str, Any]:
    fit = model.fit
    value, low, high = (
        round_digits(stated + unit * float(numbers[place]))
        for numbers in (fit.coefficients, fit.low, fit.high)
    )
    return {"value": value, "ci95": [low, high], "at_bound": bool(fit.at_bound[place])}
