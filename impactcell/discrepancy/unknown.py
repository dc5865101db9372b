"""A gap that no known effect explains: where it is, its shape, and a free-form term that would close it."""

from dataclasses import dataclass

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.alone import Alone, alone
from impactcell.discrepancy.evidence import ALPHA, Evidence
from impactcell.discrepancy.locate import ALL
from impactcell.discrepancy.phases import BETWEEN_SHOTS, PHASES, course_of, phases
from impactcell.discrepancy.problem import Problem
from impactcell.discrepancy.shots import CHANNELS, Index
from impactcell.records import Samples

STRONG_SHARE = 0.25
SMALL = 1.1
AFTER = frozenset({"free_slide", "stop", "driven"})


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """Free-form residual along one phase of one channel, in units of the noise.

    Attributes
    ----------
    place : ndarray, shape (k,)
        Place within the phase, 0 to 1.
    mean : ndarray, shape (k,)
    """

    phase: str
    channel: str
    place: Samples
    mean: Samples


@dataclass(frozen=True, slots=True, eq=False)
class Unexplained:
    """What is left.

    Attributes
    ----------
    phase : str
        Where the gap is largest.
    depends_on : tuple of str
        Covariates with which it changes, significantly over the whole map.
    shape : str
        In words.
    shapes : tuple of Shape
        To be drawn.
    alone : Alone, optional
        Contact and slide fitted alone, of taps.
    """

    phase: str
    depends_on: tuple[str, ...]
    shape: str
    shapes: tuple[Shape, ...]
    alone: Alone | None


def by_phase(evidence: Evidence) -> dict[str, float]:
    """First-order gain of each row of the map, the largest over its cells."""
    chart = evidence.map
    gain = evidence.map_scores.gain
    made = {}
    for row, phase in enumerate(chart.rows):
        mine = chart.cell // len(chart.columns) == row
        per_column = [
            float(gain[mine & (chart.cell % len(chart.columns) == column)].sum())
            for column in range(len(chart.columns))
        ]
        made[phase] = max(per_column)
    return made


def phase_of_gap(problem: Problem, evidence: Evidence, parts: Alone | None) -> str:
    """Phase in which a gap arises.

    A gap that shows in the friction factors only is where the map is strongest. Of a tap, contact and slide
    are fitted alone: the one that stays farther above the floor is where something is missing, and its phase
    with the largest share of the squared residuals is named. Where neither does, the whole shots' residuals
    decide.
    """
    if evidence.fit.misfit(problem.shots).sum() <= SMALL * problem.shots.values.size:
        return _strongest(evidence)
    phase = phases(problem, course_of(problem, evidence.fit))
    excess = {
        name: float((evidence.fit.residual[phase == number] ** 2 - 1.0).sum())
        for number, name in enumerate(PHASES)
        if (phase == number).any()
    }
    after = {name: value for name, value in excess.items() if name in AFTER}
    contact = {name: value for name, value in excess.items() if name not in AFTER}
    in_contact = sum(contact.values()) > sum(after.values())
    if parts is not None:
        found = np.nan_to_num([parts.contact, parts.slide], nan=1.0)
        if found.max() > SMALL:
            in_contact = bool(found[0] > found[1])
    side = contact if (in_contact and contact) or not after else after
    return max(side, key=lambda name: side[name])


def _strongest(evidence: Evidence) -> str:
    strength = by_phase(evidence)
    return max(strength, key=lambda name: strength[name])


def describe(problem: Problem, evidence: Evidence) -> Unexplained:
    """Describe what a fitted model leaves."""
    chart, tests, made = evidence.map, evidence.map_tests, evidence.map_scores
    taps = problem.shots.excitation is Excitation.TAP
    parts = alone(problem, evidence.fit) if taps else None
    phase = phase_of_gap(problem, evidence, parts)
    if phase not in chart.rows:
        phase = _strongest(evidence)
    row = chart.rows.index(phase)
    p = np.ones(len(chart.columns))
    for column in range(len(chart.columns)):
        cell = row * len(chart.columns) + column
        if cell < len(tests.adjusted):
            p[column] = tests.adjusted[cell]
    depends = tuple(
        name for column, name in enumerate(chart.columns) if name != ALL and p[column] <= ALPHA * 5.0
    )
    shapes = []
    if phase != BETWEEN_SHOTS:
        for channel, sensor in enumerate(CHANNELS):
            mine = (chart.cell == row * len(chart.columns)) & (chart.channel == channel)
            if mine.any():
                shapes.append(Shape(phase, sensor, chart.place[mine], made.amplitude[mine]))
    return Unexplained(
        phase,
        depends,
        _in_words(phase, shapes, made.gain, chart.cell, row * len(chart.columns)),
        tuple(shapes),
        parts,
    )


def _in_words(phase: str, shapes: list[Shape], gain: Samples, cell: Index, whole: int) -> str:
    if phase == BETWEEN_SHOTS:
        return "the friction factors change from shot to shot with the covariates named"
    strongest = max(shapes, key=lambda shape: float(np.abs(shape.mean).max()), default=None)
    if strongest is None or not float(gain[cell == whole].max(initial=0.0)) > 0.0:
        return "no mean shape: it changes with the covariates only"
    mean = strongest.mean
    signs = np.sign(mean[np.abs(mean) > STRONG_SHARE * np.abs(mean).max()])
    turns = int(np.sum(signs[1:] != signs[:-1]))
    kind = {0: "one-sided", 1: "S-shaped", 2: "bowed"}.get(turns, f"oscillating ({turns} changes of sign)")
    where = float(strongest.place[int(np.argmax(np.abs(mean)))])
    part = "early" if where < 1 / 3 else "in the middle" if where < 2 / 3 else "late"
    return f"{kind} in {strongest.channel}, largest {part} in the phase"
