"""A gap that no known effect explains: where it is, its shape, and a free-form term that would close it."""

from dataclasses import dataclass

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.shots import CHANNELS
from impactcell.discrepancy.model.phases import BETWEEN_SHOTS, PHASES, course_of, phases
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.model.split_fits import Alone, alone
from impactcell.discrepancy.search.evidence import ALPHA, Evidence
from impactcell.discrepancy.search.residual_map import ALL
from impactcell.records import Samples

STRONG_SHARE = 0.25
SMALL = 1.1
AFTER = frozenset({"free_slide", "stop", "driven"})


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """Free-form residual along one phase of one channel, in units of the noise.

    Attributes
    ----------
    times : str
        Covariate (centred, over its standard deviation) that multiplies the shape; empty for the mean.
    place : ndarray, shape (k,)
        Place within the phase, 0 to 1.
    size : ndarray, shape (k,)
    """

    phase: str
    channel: str
    times: str
    place: Samples
    size: Samples


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
    """Row of the map with the most significant cell; of equals the one that promises most."""
    chart, gain = evidence.map, evidence.map_scores.gain
    cells = range(len(evidence.map_tests.adjusted))
    best = min(
        cells,
        key=lambda cell: (evidence.map_tests.adjusted[cell], -gain[chart.cell == cell].max(initial=0.0)),
    )
    return chart.rows[best // len(chart.columns)]


def describe(problem: Problem, evidence: Evidence) -> Unexplained:
    """Describe what a fitted model leaves."""
    chart, tests = evidence.map, evidence.map_tests
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
    shapes = _shapes(evidence, row, depends) if phase != BETWEEN_SHOTS else ()
    return Unexplained(phase, depends, _in_words(phase, shapes), shapes, parts)


def _shapes(evidence: Evidence, row: int, depends: tuple[str, ...]) -> tuple[Shape, ...]:
    """Free-form shape in each channel: its mean, or what changes with the covariate that shows more of it."""
    chart, made = evidence.map, evidence.map_scores
    shapes = []
    for channel, sensor in enumerate(CHANNELS):
        best, most = None, 0.0
        for covariate in (ALL, *depends):
            cell = row * len(chart.columns) + chart.columns.index(covariate)
            mine = (chart.cell == cell) & (chart.channel == channel)
            gain = float(made.gain[mine].max(initial=0.0))
            if gain > most:
                times = "" if covariate == ALL else covariate
                best = Shape(chart.rows[row], sensor, times, chart.place[mine], made.amplitude[mine])
                most = gain
        if best is not None:
            shapes.append(best)
    return tuple(shapes)


def _in_words(phase: str, shapes: tuple[Shape, ...]) -> str:
    if phase == BETWEEN_SHOTS:
        return "the friction factors change from shot to shot with the covariates named"
    if not shapes:
        return "no smooth shape along the phase"
    strongest = max(shapes, key=lambda shape: float(np.abs(shape.size).max()))
    size = strongest.size
    signs = np.sign(size[np.abs(size) > STRONG_SHARE * np.abs(size).max()])
    turns = int(np.sum(signs[1:] != signs[:-1]))
    kind = {0: "one-sided", 1: "S-shaped", 2: "bowed"}.get(turns, f"oscillating ({turns} changes of sign)")
    where = float(strongest.place[int(np.argmax(np.abs(size)))])
    part = "early" if where < 1 / 3 else "in the middle" if where < 2 / 3 else "late"
    times = f", times {strongest.times}" if strongest.times else ""
    return f"{kind} in {strongest.channel}{times}, largest {part} in the phase"
