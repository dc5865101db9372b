"""Which known effect it is: a score for every effect of the library at every point of its grid."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data.shots import Index
from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.linearisation import Products, Scores, Tangent, products, together
from impactcell.discrepancy.model.parameters import NOMINAL, of_effect, plant_name
from impactcell.discrepancy.model.phases import course_of
from impactcell.discrepancy.model.problem import Problem, without_jumps
from impactcell.discrepancy.search.effect_grid import SMALL, Probe, Range, probes
from impactcell.errors import PhysicsError
from impactcell.physics.effect import Covariates
from impactcell.physics.effects import LIBRARY
from impactcell.physics.law_table import build_law_table
from impactcell.records import Samples

FORWARD = 0.1
"""Step forward, in units of `SMALL`."""
LARGEST = 5.0
WEAK = 0.3
"""Strengths in units of an effect's typical one."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Directions of all candidate effects about one fit.

    Attributes
    ----------
    names : tuple of str
    products : Products
    group : ndarray, shape (Q,)
        Candidate of each direction.
    side : ndarray, shape (Q,)
        +1 where only a positive amplitude makes sense, else 0.
    probes : tuple of Probe
    """

    names: tuple[str, ...]
    products: Products
    group: Index
    side: Samples
    probes: tuple[Probe, ...]


def gone_through(problem: Problem, fit: Fit) -> Range:
    """Positions and speeds that the fitted model goes through."""
    course = course_of(problem, fit)
    sizes = np.diff(problem.shots.bounds)
    sign = np.repeat([float(shot.direction) for shot in problem.shots.items], sizes)
    start = np.repeat([shot.start_m for shot in problem.shots.items], sizes)
    position = start + sign * course.advance_m
    return Range(float(position.min()), float(position.max()), float(np.abs(course.speed_m_s).max()))


def candidates(problem: Problem, fit: Fit, tangent: Tangent, library: Sequence[str]) -> Candidates:
    """Directions of the effects of `library` that the fit does not have yet."""
    gone = gone_through(problem, fit)
    names: list[str] = []
    parts: list[Products] = []
    groups: list[int] = []
    kept: list[Probe] = []
    unit = products(tangent, np.zeros(problem.shots.values.size), np.ones(problem.count))
    for identifier in library:
        if identifier in fit.effects:
            continue
        grid = probes(identifier, problem.forward.batches, gone)
        found = 0
        for probe in grid:
            between = log_factors(problem, identifier, probe)
            if between is not None:
                parts.append(unit.modulated(-between / fit.spread))
            else:
                change = direction(problem, fit, identifier, probe, alone=len(grid) == 1)
                if change is None or not change.any():
                    continue
                parts.append(products(tangent, change))
            groups.append(len(names))
            kept.append(probe)
            found += 1
        if found:
            names.append(identifier)
    side = np.array([float(probe.side) for probe in kept])
    return Candidates(tuple(names), together(parts), np.array(groups, dtype=np.int64), side, tuple(kept))


def direction(
    problem: Problem, fit: Fit, identifier: str, probe: Probe, *, alone: bool = True
) -> Samples | None:
    """Change of the whitened prediction when an effect joins at a probe; None where the plant cannot.

    A direction that is `alone` is a central difference: what the friction factors can do as well must cancel
    to the last digits. Of a whole grid each is a small step forward.
    """
    effects = (*fit.effects, identifier)
    ahead, back = probe.at.copy(), probe.at.copy()
    both = probe.scaled and probe.side == 0
    if both and alone:
        back[probe.amplitude] -= 2.0 * SMALL
    elif both:
        ahead[probe.amplitude] -= (1.0 - FORWARD) * SMALL
    try:
        there = problem.residual(effects, np.concatenate([fit.at, ahead]), fit.local)
        if both and alone:
            here = problem.residual(effects, np.concatenate([fit.at, back]), fit.local)
            change = 0.5 * (here - there)
            change[np.abs(here + there - 2.0 * fit.residual) > 1.0 + np.abs(change)] = 0.0
        elif both:
            change = without_jumps(fit.residual - there) / FORWARD
        else:
            change = fit.residual - there
            if probe.scaled:
                change = without_jumps(change)
    except PhysicsError:
        return None
    return change if np.isfinite(change).all() else None


def log_factors(problem: Problem, identifier: str, probe: Probe) -> Samples | None:
    """Logarithms of the friction factors by which an effect acts, if that is all it does; shape (n,)."""
    effect = LIBRARY[identifier]
    if effect.between is None or effect.laws:
        return None
    items = problem.shots.items
    names = build_law_table((identifier,), problem.forward.batches).names
    coordinates = of_effect(identifier, problem.forward.batches)
    values = {plant_name(one): one.value(float(at)) for one, at in zip(coordinates, probe.at, strict=True)}
    row = np.array([values[one] for one in names[len(NOMINAL) :]])
    columns = []
    place = 0
    for parameter in effect.parameters:
        width = problem.forward.batches - 1 if parameter.per_batch else 1
        own = np.tile(row[place : place + width], (len(items), 1))
        columns.append(own if parameter.per_batch else own[:, 0])
        place += width
    found = effect.between(
        columns,
        Covariates(
            dwell_s=np.array([shot.dwell_s for shot in items]),
            shot=np.array([float(shot.place) for shot in items]),
            shots=np.array([float(shot.shots) for shot in items]),
            batch=np.array([float(shot.batch) for shot in items]),
            direction=np.array([float(shot.direction) for shot in items]),
        ),
    )
    mu_s, mu_k, mass = (np.broadcast_to(one, len(items)) for one in found)
    if not (np.allclose(mu_s, mu_k, rtol=1e-12) and np.all(mass == 1.0)):
        return None
    made: Samples = np.log(np.maximum(mu_k, 1e-6))
    return made


def best_probes(found: Candidates, scored: Scores, candidate: int, most: int) -> list[tuple[float, Samples]]:
    """Gains and starting coordinates of an effect: its best probes, amplitudes scaled by their scores."""
    columns = np.flatnonzero(found.group == candidate)
    gain, amplitude = scored.gain[columns], scored.amplitude[columns]
    allowed = (found.side[columns] == 0.0) | (amplitude * found.side[columns] > 0.0)
    gain = np.where(allowed, gain, 0.0)
    phase = phase_of(found.names[candidate])
    if phase is not None:
        scale = LIBRARY[found.names[candidate]].parameters[phase].typical
        return _best_waves(found, columns, gain, amplitude, (phase, scale), most)
    made: list[tuple[float, Samples]] = []
    taken: list[Samples] = []
    for place in np.argsort(-gain, kind="stable"):
        if gain[place] <= 0.0 or len(made) == most:
            break
        probe = found.probes[int(columns[place])]
        if any(_near(probe, other) for other in taken):
            continue
        taken.append(probe.at)
        made.append((float(gain[place]), started(probe, float(amplitude[place]))))
    return made


def phase_of(identifier: str) -> int | None:
    """Place of an effect's phase angle among its parameters, if it has one."""
    for place, parameter in enumerate(LIBRARY[identifier].parameters):
        if parameter.name.endswith("phase_rad"):
            return place
    return None


def _best_waves(
    found: Candidates,
    columns: Index,
    gain: Samples,
    amplitude: Samples,
    angle: tuple[int, float],
    most: int,
) -> list[tuple[float, Samples]]:
    """Sine and cosine of the same wave make one start with an amplitude and a phase."""
    phase, scale = angle
    waves: dict[tuple[float, ...], list[int]] = {}
    for place, column in enumerate(columns):
        key = tuple(np.delete(found.probes[int(column)].at, phase))
        waves.setdefault(key, []).append(place)
    ranked = sorted(waves.values(), key=lambda pair: -float(gain[pair].sum()))
    made: list[tuple[float, Samples]] = []
    taken: list[Samples] = []
    for pair in ranked:
        probe = found.probes[int(columns[pair[0]])]
        if len(made) == most or not gain[pair].sum() > 0.0:
            break
        if any(_near(probe, other) for other in taken):
            continue
        taken.append(probe.at)
        angles = [float(found.probes[int(columns[i])].at[phase]) * scale for i in pair]
        sine = sum(float(amplitude[i]) * math.cos(a) for i, a in zip(pair, angles, strict=True))
        cosine = sum(float(amplitude[i]) * math.sin(a) for i, a in zip(pair, angles, strict=True))
        at = started(probe, math.hypot(sine, cosine))
        at[phase] = math.atan2(cosine, sine) / scale
        made.append((float(gain[pair].sum()), at))
    return made


def _near(probe: Probe, other: Samples) -> bool:
    """Neighbours on the grid lead to the same optimum."""
    apart = np.abs(probe.at - other)
    return bool(np.all(apart <= 0.12 * np.maximum(np.abs(other), 0.3)))


def started(probe: Probe, amplitude: float) -> Samples:
    """Coordinates at which a fit starts, the strength scaled by the score's own estimate."""
    at = probe.at.copy()
    if not probe.scaled:
        return at
    base = at[probe.amplitude] - SMALL
    at[probe.amplitude] = base + float(np.clip(SMALL * amplitude, -LARGEST, LARGEST))
    return at


def starts(found: Candidates, scored: Scores, effect: str, most: int) -> list[Samples]:
    """Where fits of an effect start: its best probes, as strong as the score says and much weaker.

    A score is a slope; where the gap is wide the effect it promises may lie far beyond what the plant can do.
    """
    number = found.names.index(effect)
    best = [start for _, start in best_probes(found, scored, number, most)]
    probe = found.probes[int(np.argmax(found.group == number))]
    made: list[Samples] = []
    for start in best:
        made.append(start)
        if probe.scaled:
            base = probe.at[probe.amplitude] - SMALL
            away = start[probe.amplitude] - base
            if abs(away) > WEAK:
                weaker = start.copy()
                weaker[probe.amplitude] = base + math.copysign(WEAK, away)
                made.append(weaker)
    return made
