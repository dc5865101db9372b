"""Which known effect it is: a score for every effect of the library at every point of its grid."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data import IndexArray
from impactcell.discrepancy.model import (
    DirectionProducts,
    Fit,
    LinearisedFit,
    Problem,
    Scores,
    concatenate_products,
    direction_products,
    effect_coordinates,
    parameter_name,
    remove_jumps,
    trajectory_of,
)
from impactcell.discrepancy.search.effect_grid import SMALL_STRENGTH, GridPoint, VisitedRange, effect_grid
from impactcell.errors import PhysicsError
from impactcell.physics.effect import Covariates, ParameterKind
from impactcell.physics.effects import LIBRARY
from impactcell.physics.law_table import NOMINAL_PARAMETERS, build_law_table
from impactcell.records import Samples

FORWARD_STEP = 0.1
"""Step forward, in units of `SMALL_STRENGTH`."""
MAX_STRENGTH = 5.0
"""Strongest start of a fit, in units of an effect's typical strength."""
WEAK_STRENGTH = 0.3
"""A second start of a fit, much weaker than the score promises, in the same units."""
ALIKE_FACTORS = 1e-9
"""Spread of the logarithms of shots' factors up to which an effect is the same in all of them."""


@dataclass(frozen=True, slots=True, eq=False)
class CandidateDirections:
    """Directions of all candidate effects about one fit.

    Attributes
    ----------
    names : tuple of str
    products : DirectionProducts
    group : ndarray, shape (Q,)
        Candidate of each direction.
    sign : ndarray, shape (Q,)
        +1 where only a positive amplitude makes sense, else 0.
    points : tuple of GridPoint
    """

    names: tuple[str, ...]
    products: DirectionProducts
    group: IndexArray
    sign: Samples
    points: tuple[GridPoint, ...]


def visited_range(problem: Problem, fit: Fit) -> VisitedRange:
    """Positions and speeds that the fitted model goes through."""
    trajectory = trajectory_of(problem, fit)
    sizes = np.diff(problem.shots.bounds)
    sign = np.repeat([float(shot.direction) for shot in problem.shots.items], sizes)
    start = np.repeat([shot.start_m for shot in problem.shots.items], sizes)
    position = start + sign * trajectory.part_displacement_m
    return VisitedRange(
        float(position.min()), float(position.max()), float(np.abs(trajectory.speed_m_s).max())
    )


def candidate_directions(
    problem: Problem, fit: Fit, linearisation: LinearisedFit, library: Sequence[str]
) -> CandidateDirections:
    """Directions of the effects of `library` that the fit does not have yet."""
    visited = visited_range(problem, fit)
    names: list[str] = []
    groups: list[int] = []
    points: list[GridPoint] = []
    unit = direction_products(linearisation, np.zeros(problem.shots.values.size), np.ones(problem.count))
    parts = [unit.select(np.arange(0))]  # and no more, where the shots can test no effect of the library
    for identifier in library:
        if identifier in fit.effects:
            continue
        grid = effect_grid(identifier, problem.batches, visited)
        count = 0
        for point in grid:
            between = between_shot_factors(problem, identifier, point)
            if between is not None:
                if float(np.ptp(between)) <= ALIKE_FACTORS:  # one factor of all shots: mu itself
                    continue
                parts.append(unit.modulate(-between / fit.spread))
            else:
                change = effect_direction(problem, fit, identifier, point, is_single=len(grid) == 1)
                if change is None or not change.any():
                    continue
                parts.append(direction_products(linearisation, change))
            groups.append(len(names))
            points.append(point)
            count += 1
        if count:
            names.append(identifier)
    side = np.array([float(point.sign) for point in points])
    return CandidateDirections(
        tuple(names), concatenate_products(parts), np.array(groups, dtype=np.int64), side, tuple(points)
    )


def effect_direction(
    problem: Problem, fit: Fit, identifier: str, point: GridPoint, *, is_single: bool = True
) -> Samples | None:
    """Change of the whitened prediction when an effect joins at a probe; None where the plant cannot.

    A direction that `is_single` is a central difference: what the friction factors can do as well must cancel
    to the last digits. Of a whole grid each is a small step forward.
    """
    model = problem.with_effects((*fit.effects, identifier))
    forward_theta, backward_theta = point.theta.copy(), point.theta.copy()
    both = point.scaled and point.sign == 0
    if both and is_single:
        backward_theta[point.amplitude] -= 2.0 * SMALL_STRENGTH
    elif both:
        forward_theta[point.amplitude] -= (1.0 - FORWARD_STEP) * SMALL_STRENGTH
    try:
        forward = model.residual(np.concatenate([fit.theta, forward_theta]), fit.shot_parameters)
        if both and is_single:
            backward = model.residual(np.concatenate([fit.theta, backward_theta]), fit.shot_parameters)
            change = 0.5 * (backward - forward)
            change[np.abs(backward + forward - 2.0 * fit.residual) > 1.0 + np.abs(change)] = 0.0
        elif both:
            change = remove_jumps(fit.residual - forward) / FORWARD_STEP
        else:
            change = fit.residual - forward
            if point.scaled:
                change = remove_jumps(change)
    except PhysicsError:
        return None
    return change if np.isfinite(change).all() else None


def between_shot_factors(problem: Problem, identifier: str, point: GridPoint) -> Samples | None:
    """Logarithms of the friction factors by which an effect acts, if that is all it does; shape (n,)."""
    effect = LIBRARY[identifier]
    if effect.between is None or effect.laws:
        return None
    items = problem.shots.items
    names = build_law_table((identifier,), problem.batches).names
    coordinates = effect_coordinates(identifier, problem.batches)
    values = {
        parameter_name(coordinate): coordinate.value(float(theta))
        for coordinate, theta in zip(coordinates, point.theta, strict=True)
    }
    row = np.array([values[coordinate] for coordinate in names[len(NOMINAL_PARAMETERS) :]])
    columns = []
    place = 0
    for parameter in effect.parameters:
        width = problem.batches - 1 if parameter.per_batch else 1
        values_of_shots = np.tile(row[place : place + width], (len(items), 1))
        columns.append(values_of_shots if parameter.per_batch else values_of_shots[:, 0])
        place += width
    factors = effect.between(
        columns,
        Covariates(
            dwell_s=np.array([shot.dwell_s for shot in items]),
            shot=np.array([float(shot.record) for shot in items]),
            shots=np.array([float(shot.records) for shot in items]),
            batch=np.array([float(shot.batch) for shot in items]),
            direction=np.array([float(shot.direction) for shot in items]),
            columns={
                name: np.array([shot.covariates.get(name, np.nan) for shot in items])
                for name in effect.columns
            },
        ),
    )
    mu_s, mu_k, mass = (np.broadcast_to(coordinate, len(items)) for coordinate in factors)
    if not (np.allclose(mu_s, mu_k, rtol=1e-12) and np.all(mass == 1.0)):
        return None
    log_factor: Samples = np.log(np.maximum(mu_k, 1e-6))
    return log_factor


def best_points(
    directions: CandidateDirections, scored: Scores, candidate: int, max_points: int
) -> list[tuple[float, Samples]]:
    """Gains and starting coordinates of an effect: its best probes, amplitudes scaled by their scores."""
    columns = np.flatnonzero(directions.group == candidate)
    gain, amplitude = scored.gain[columns], scored.amplitude[columns]
    allowed = (directions.sign[columns] == 0.0) | (amplitude * directions.sign[columns] > 0.0)
    gain = np.where(allowed, gain, 0.0)
    phase = phase_angle_index(directions.names[candidate])
    if phase is not None:
        scale = LIBRARY[directions.names[candidate]].parameters[phase].typical
        return _best_waves(directions, columns, gain, amplitude, (phase, scale), max_points)
    best: list[tuple[float, Samples]] = []
    chosen: list[Samples] = []
    for place in np.argsort(-gain, kind="stable"):
        if gain[place] <= 0.0 or len(best) == max_points:
            break
        point = directions.points[int(columns[place])]
        if any(_are_neighbours(point, other) for other in chosen):
            continue
        chosen.append(point.theta)
        best.append((float(gain[place]), start_coordinates(point, float(amplitude[place]))))
    return best


def phase_angle_index(identifier: str) -> int | None:
    """Place of an effect's phase angle among its parameters, if it has one."""
    for place, parameter in enumerate(LIBRARY[identifier].parameters):
        if parameter.kind is ParameterKind.PHASE:
            return place
    return None


def _best_waves(
    directions: CandidateDirections,
    columns: IndexArray,
    gain: Samples,
    amplitude: Samples,
    angle: tuple[int, float],
    max_points: int,
) -> list[tuple[float, Samples]]:
    """Sine and cosine of the same wave make one start with an amplitude and a phase."""
    phase, scale = angle
    waves: dict[tuple[float, ...], list[int]] = {}
    for place, column in enumerate(columns):
        key = tuple(np.delete(directions.points[int(column)].theta, phase))
        waves.setdefault(key, []).append(place)
    ranked = sorted(waves.values(), key=lambda pair: -float(gain[pair].sum()))
    best: list[tuple[float, Samples]] = []
    chosen: list[Samples] = []
    for pair in ranked:
        point = directions.points[int(columns[pair[0]])]
        if len(best) == max_points or not gain[pair].sum() > 0.0:
            break
        if any(_are_neighbours(point, other) for other in chosen):
            continue
        chosen.append(point.theta)
        angles = [float(directions.points[int(columns[i])].theta[phase]) * scale for i in pair]
        sine = sum(float(amplitude[i]) * math.cos(a) for i, a in zip(pair, angles, strict=True))
        cosine = sum(float(amplitude[i]) * math.sin(a) for i, a in zip(pair, angles, strict=True))
        theta = start_coordinates(point, math.hypot(sine, cosine))
        theta[phase] = math.atan2(cosine, sine) / scale
        best.append((float(gain[pair].sum()), theta))
    return best


def _are_neighbours(point: GridPoint, other: Samples) -> bool:
    """Neighbours on the grid lead to the same optimum."""
    apart = np.abs(point.theta - other)
    return bool(np.all(apart <= 0.12 * np.maximum(np.abs(other), 0.3)))


def start_coordinates(point: GridPoint, amplitude: float) -> Samples:
    """Coordinates at which a fit starts, the strength scaled by the score's own estimate."""
    theta = point.theta.copy()
    if not point.scaled:
        return theta
    base = theta[point.amplitude] - SMALL_STRENGTH
    theta[point.amplitude] = base + float(np.clip(SMALL_STRENGTH * amplitude, -MAX_STRENGTH, MAX_STRENGTH))
    return theta


def starting_points(
    directions: CandidateDirections, scored: Scores, effect: str, max_points: int
) -> list[Samples]:
    """Where fits of an effect start: its best probes, as strong as the score says and much weaker.

    A score is a slope; where the gap is wide the effect it promises may lie far beyond what the plant can do.
    """
    number = directions.names.index(effect)
    best = [start for _, start in best_points(directions, scored, number, max_points)]
    point = directions.points[int(np.argmax(directions.group == number))]
    initial_thetas: list[Samples] = []
    for start in best:
        initial_thetas.append(start)
        if point.scaled:
            base = point.theta[point.amplitude] - SMALL_STRENGTH
            away = start[point.amplitude] - base
            if abs(away) > WEAK_STRENGTH:
                weaker = start.copy()
                weaker[point.amplitude] = base + math.copysign(WEAK_STRENGTH, away)
                initial_thetas.append(weaker)
    return initial_thetas
