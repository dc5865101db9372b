"""Which known effect it is: a score for every effect of the library at every point of its grid."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.fit import Fit, Problem
from impactcell.discrepancy.phases import course_of
from impactcell.discrepancy.probes import SMALL, Probe, Range, probes
from impactcell.discrepancy.shots import Index
from impactcell.discrepancy.tangent import Products, Scores, Tangent, products, together
from impactcell.errors import PhysicsError
from impactcell.physics.effects import LIBRARY
from impactcell.records import Samples

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
    for identifier in library:
        if identifier in fit.effects:
            continue
        grid = probes(identifier, problem.forward.batches, gone)
        found = 0
        for probe in grid:
            change = direction(problem, fit, identifier, probe)
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


def direction(problem: Problem, fit: Fit, identifier: str, probe: Probe) -> Samples | None:
    """Change of the whitened prediction when an effect joins at a probe; None where the plant cannot."""
    try:
        with_effect = problem.residual(
            (*fit.effects, identifier), np.concatenate([fit.at, probe.at]), fit.local
        )
    except PhysicsError:
        return None
    change = fit.residual - with_effect
    return change if np.isfinite(change).all() else None


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
