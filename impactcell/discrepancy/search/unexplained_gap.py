"""A gap that no known effect explains: where it is, its shape, and a free-form term that would close it."""

from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data import BETWEEN_SHOTS, CHANNELS, PHASES
from impactcell.discrepancy.model import Problem, SplitFits, fit_split, sample_phases, trajectory_of
from impactcell.discrepancy.search.evidence import ModelEvidence
from impactcell.discrepancy.search.residual_map import ALL
from impactcell.records import Samples

STRONG_SHARE = 0.25
"""Share of the largest amplitude from which on the sign of a shape counts."""
NO_GAP_RMS = 1.1
"""RMS in noise floors up to which traces show no gap."""
MAX_P_DEPENDS_ON = 0.05
"""p-value over the whole map up to which a gap is said to depend on a covariate."""
AFTER_SEPARATION = frozenset({"free_slide", "stop", "driven"})
"""Phases without contact."""


@dataclass(frozen=True, slots=True, eq=False)
class ResidualShape:
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
class UnexplainedGap:
    """What is left.

    Attributes
    ----------
    phase : str
        Where the gap is largest.
    depends_on : tuple of str
        Covariates with which it changes, significantly over the whole map.
    shape : str
        In words.
    shapes : tuple of ResidualShape
        To be drawn.
    split_fits : SplitFits, optional
        Contact and slide fitted alone, of taps.
    """

    phase: str
    depends_on: tuple[str, ...]
    shape: str
    shapes: tuple[ResidualShape, ...]
    split_fits: SplitFits | None


def phase_of_gap(problem: Problem, evidence: ModelEvidence, parts: SplitFits | None) -> str:
    """Phase in which a gap arises.

    A gap that shows in the friction factors only is where the map is strongest. Of a tap, contact and slide
    are fitted alone: the one that stays farther above the floor is where something is missing, and its phase
    with the largest share of the squared residuals is named. Where neither does, the whole shots' residuals
    decide.
    """
    if evidence.fit.misfit(problem.shots).sum() <= NO_GAP_RMS * problem.shots.values.size:
        return _strongest_row(evidence)
    phase = sample_phases(problem, trajectory_of(problem, evidence.fit))
    excess = {
        name: float((evidence.fit.residual[phase == number] ** 2 - 1.0).sum())
        for number, name in enumerate(PHASES)
        if (phase == number).any()
    }
    after = {name: value for name, value in excess.items() if name in AFTER_SEPARATION}
    contact = {name: value for name, value in excess.items() if name not in AFTER_SEPARATION}
    in_contact = sum(contact.values()) > sum(after.values())
    if parts is not None:
        rms = np.nan_to_num([parts.contact, parts.slide], nan=1.0)
        if rms.max() > NO_GAP_RMS:
            in_contact = bool(rms[0] > rms[1])
    side = contact if (in_contact and contact) or not after else after
    return max(side, key=lambda name: side[name])


def _strongest_row(evidence: ModelEvidence) -> str:
    """Row of the map with the most significant cell; of equals the one that promises most."""
    chart, gain = evidence.map, evidence.map_scores.gain
    cells = range(len(evidence.map_tests.p_adjusted))
    best = min(
        cells,
        key=lambda cell: (evidence.map_tests.p_adjusted[cell], -gain[chart.cell == cell].max(initial=0.0)),
    )
    return chart.rows[best // len(chart.columns)]


def describe_gap(problem: Problem, evidence: ModelEvidence) -> UnexplainedGap:
    """Describe what a fitted model leaves."""
    chart, tests = evidence.map, evidence.map_tests
    taps = problem.shots.excitation.has_contact
    parts = fit_split(problem, evidence.fit) if taps else None
    phase = phase_of_gap(problem, evidence, parts)
    if phase not in chart.rows:
        phase = _strongest_row(evidence)
    row = chart.rows.index(phase)
    p = np.ones(len(chart.columns))
    for column in range(len(chart.columns)):
        cell = row * len(chart.columns) + column
        if cell < len(tests.p_adjusted):
            p[column] = tests.p_adjusted[cell]
    depends = tuple(
        name for column, name in enumerate(chart.columns) if name != ALL and p[column] <= MAX_P_DEPENDS_ON
    )
    shapes = _shapes(evidence, row, depends) if phase != BETWEEN_SHOTS else ()
    return UnexplainedGap(phase, depends, _in_words(phase, shapes), shapes, parts)


def _shapes(evidence: ModelEvidence, row: int, depends: tuple[str, ...]) -> tuple[ResidualShape, ...]:
    """Free-form shape in each channel: its mean, or what changes with the covariate that shows more of it."""
    chart, map_scores = evidence.map, evidence.map_scores
    shapes = []
    for channel, sensor in enumerate(CHANNELS):
        best, largest_gain = None, 0.0
        for covariate in (ALL, *depends):
            cell = row * len(chart.columns) + chart.columns.index(covariate)
            in_cell = (chart.cell == cell) & (chart.channel == channel)
            gain = float(map_scores.gain[in_cell].max(initial=0.0))
            if gain > largest_gain:
                times = "" if covariate == ALL else covariate
                best = ResidualShape(
                    chart.rows[row], sensor, times, chart.place[in_cell], map_scores.amplitude[in_cell]
                )
                largest_gain = gain
        if best is not None:
            shapes.append(best)
    return tuple(shapes)


def _in_words(phase: str, shapes: tuple[ResidualShape, ...]) -> str:
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
