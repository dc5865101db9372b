"""Intervals where a linearised fit does not tell how far data allow a coordinate to go: by refits along it.

It tells nothing of what lies further along a coordinate that ends at a bound. mu_s/mu_k beside a compliant
stiction has no slope at 1, and yet at 1.3 the fit is as good, with another stiffness of the stiction.
Nor is the curvature at the optimum that further on where it falls: the smaller mu_s, the sooner a part breaks
away, and the less its first motion shows of it.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from impactcell.discrepancy.model.intervals import (
    ParameterEstimate,
    SharedError,
    estimate_parameters,
    interval_quantile,
    inverse_of,
)
from impactcell.discrepancy.model.least_squares import Fit, fit
from impactcell.discrepancy.model.linearisation import LinearisedFit, linearise
from impactcell.discrepancy.model.problem import Problem
from impactcell.errors import DiscrepancyError
from impactcell.physics import ParameterKind
from impactcell.physics.effects import find_effect
from impactcell.records import Samples

HALVINGS = 5
"""Times that the way to the end of an interval is halved to find how far the data allow it."""
BENT, STEPS_OUT = "ratio", 8
"""Coordinate of the plant along which the curvature changes much, mu_s/mu_k, and how many halves of its
interval the data may allow it to go."""


def profile_parameters(
    problem: Problem,
    model: Fit,
    linearisation: LinearisedFit,
    shared_error: SharedError | None = None,
    penalty: Samples | None = None,
) -> tuple[ParameterEstimate, ...]:
    """Every shared parameter; where an interval ends at a bound, the others hold for all that fits as well.

    Along such a coordinate the others are refitted as far as the cost rises by no more than the squared
    quantile of the intervals (profile likelihood; Venzon and Moolgavkar 1988); their intervals hold those of
    the optimum and of both ends. A coordinate whose interval is all its range is as uncertain as it moves.
    mu_s/mu_k, along which the curvature changes, goes as far as the cost rises by what its interval's end
    would make it rise by with the curvature at the optimum. A penalty is that of the fit, shape (p, p).
    """
    estimates = estimate_parameters(model, linearisation, shared_error, penalty)
    estimates = tuple(
        _as_far_as_it_bends(problem, model, linearisation, column, estimate)
        if estimate.parameter == BENT and not estimate.effect and not estimate.at_bound and penalty is None
        else estimate
        for column, estimate in enumerate(estimates)
    )
    quantile = interval_quantile(model, linearisation, penalty)
    limit = quantile**2 * max(linearisation.mean_squared_residual, 1.0)
    joined = estimates
    for column, estimate in enumerate(estimates):
        if not estimate.at_bound or _is_angle(estimate):
            continue
        coordinate = model.coordinates[column]
        ends = [coordinate.coordinate(end) for end in (estimate.low, estimate.high)]
        reached = [_furthest(problem, model, column, end, limit) for end in ends]
        for furthest in filter(None, reached):
            there = estimate_parameters(furthest, linearise(problem, furthest), shared_error, penalty)
            joined = join_intervals(joined, (*there[:column], *there[column + 1 :]))
        if any(reached) and sorted(ends) == [coordinate.lower, coordinate.upper]:
            values = sorted(coordinate.value(float((one or model).theta[column])) for one in reached)
            own = replace(estimate, low=values[0], high=values[1])
            joined = (*joined[:column], own, *joined[column + 1 :])
    return joined


def _as_far_as_it_bends(
    problem: Problem, model: Fit, linearisation: LinearisedFit, column: int, estimate: ParameterEstimate
) -> ParameterEstimate:
    """Widen an interval to where the profile of the cost is as high as a parabola would be at its ends."""
    coordinate, middle = model.coordinates[column], float(model.theta[column])
    curvature = 1.0 / inverse_of(linearisation.information)[column, column]
    values = [estimate.low, estimate.high]
    for end in (estimate.low, estimate.high):
        half = coordinate.coordinate(end) - middle
        limit = curvature * half**2
        reached = _outwards(problem, model, column, half, limit)
        values.append(coordinate.value(float(reached.theta[column])))
    low, high = min(values), max(values)
    ends = (coordinate.value(coordinate.lower), coordinate.value(coordinate.upper))
    return replace(estimate, low=low, high=high, at_bound=low <= ends[0] or high >= ends[1])


def join_intervals(
    first: Sequence[ParameterEstimate], other: Iterable[ParameterEstimate]
) -> tuple[ParameterEstimate, ...]:
    """Widen the intervals of estimates so that they hold those of the same parameters of another model."""
    found = {(one.effect, one.parameter, one.batch): one for one in other}
    return tuple(_joined(one, found.get((one.effect, one.parameter, one.batch), one)) for one in first)


def _joined(first: ParameterEstimate, other: ParameterEstimate) -> ParameterEstimate:
    """Widen one interval; an angle's by the turn that is nearest."""
    turns = round((first.value - other.value) / (2.0 * math.pi)) if _is_angle(first) else 0
    low, high = other.low + 2.0 * math.pi * turns, other.high + 2.0 * math.pi * turns
    return replace(
        first,
        low=min(first.low, low),
        high=max(first.high, high),
        at_bound=first.at_bound or other.at_bound,
    )


def _is_angle(estimate: ParameterEstimate) -> bool:
    parameters = find_effect(estimate.effect).parameters if estimate.effect else ()
    return any(one.name == estimate.parameter and one.kind is ParameterKind.PHASE for one in parameters)


def _outwards(problem: Problem, model: Fit, column: int, half: float, limit: float) -> Fit:
    """Fit with a coordinate as far out as the data allow, by steps of the half of its interval."""
    coordinate, reached = model.coordinates[column], model
    for step in range(1, STEPS_OUT + 1):
        out = float(model.theta[column]) + step * half
        end = min(max(out, coordinate.lower), coordinate.upper)
        refitted = _pinned_fit(problem, reached, column, end)
        if refitted is None or refitted.state.cost > model.state.cost + limit:
            risen = model.state.cost + limit - reached.state.cost
            beyond = _furthest(problem, reached, column, end, risen) if step > 1 else None
            return beyond or reached
        reached = refitted
        if end != out:
            break
    return reached


def _furthest(problem: Problem, model: Fit, column: int, end: float, limit: float) -> Fit | None:
    """Fit with a coordinate as near to `end` as the data allow; None where it does not move."""
    near, far = float(model.theta[column]), end
    if near == far or not math.isfinite(far):
        return None
    most = model.state.cost + limit
    reached: Fit | None = None
    tried = far
    for _ in range(HALVINGS + 1):
        refitted = _pinned_fit(problem, reached or model, column, tried)
        if refitted is not None and refitted.state.cost <= most:
            reached, near = refitted, tried
        else:
            far = tried
        if near == far:
            break
        tried = 0.5 * (near + far)
    return reached


def _pinned_fit(problem: Problem, start: Fit, column: int, value: float) -> Fit | None:
    """Refit with one coordinate where it is put; None where the plant has no answer there."""
    theta = start.theta.copy()
    theta[column] = value
    pinned = problem.with_effects(start.effects).pinned(column, value)
    try:
        fitted = fit(pinned, theta, start.shot_parameters, spread=start.spread)
    except DiscrepancyError:
        return None
    return replace(fitted, coordinates=start.coordinates)
