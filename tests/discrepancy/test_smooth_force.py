"""Evidence for a term beside a smooth force, by dense normal distributions, and what is named by it."""

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from impactcell.api.machine_findings import write_machine_findings
from impactcell.discrepancy.machine import MIN_NEED, MachineFinding, NumberPrior, investigate_machine
from impactcell.discrepancy.machine.regression import smooth_force
from impactcell.discrepancy.machine.regression.smooth_force import NAME, SmoothForce, smooth_force_columns
from impactcell.discrepancy.machine.regression.weak_form import Column, Rows
from impactcell.discrepancy.machine.search.selection import SMOOTH_FORCE
from impactcell.discrepancy.machine.terms import smooth_waves
from impactcell.discrepancy.machine.terms.catalogue import MotionState
from impactcell.discrepancy.report.machine_page import format_need
from impactcell.records import Samples
from tests.discrepancy.smooth_slide import SLIDE, Law, slide, wandering

pytestmark = pytest.mark.slow

OFFSET, FREE, OWN, DRAG = ("offset", 0.0, 0), ("free", 0.0, 0), ("own", 0.0, 0), ("drag", 0.0, 0)
RANGES = {"position": (-0.3, 0.7), "speed": (0.0, 2.0), "load": (0.0, 1.0)}


def motion(position: Samples, velocity: Samples) -> MotionState:
    nothing = np.zeros_like(position)
    return MotionState(position, velocity, nothing, nothing)


@pytest.mark.parametrize("length", smooth_force.LENGTHS)
def test_the_waves_make_a_force_of_one_size_and_correlation_length(length: float) -> None:
    """Squared exponential over half the ranges, away from the box, at which it is zero."""
    rng = np.random.default_rng(3)
    reach = smooth_waves.BOX - 1.4 * length
    x, u = rng.uniform(-reach, reach, (2, 40))
    columns = smooth_force_columns(motion(0.2 + 0.5 * x, 2.0 * u), np.sign(u), RANGES)
    waves = np.stack([values for name, values in columns.items() if name[0] == NAME], axis=1)
    covariance = waves * smooth_waves.spectrum(length) @ waves.T
    square = np.subtract.outer(x, x) ** 2 + np.subtract.outer(u, u) ** 2
    assert covariance == pytest.approx(np.exp(-0.5 * square / length**2), abs=0.06)


def rows_of(target: Samples, columns: dict[Column, Samples], waves: Samples, sigma: float) -> Rows:
    count = len(target)
    every = columns | {(NAME, 0.0, number): wave for number, wave in enumerate(waves.T)}
    nothing = np.zeros(count)
    return Rows(target, every, nothing, np.arange(float(count)), np.full(count, sigma**2), nothing)


def visited(seed: int, count: int) -> tuple[np.random.Generator, Samples, Samples, Samples]:
    """Places and speeds over half their ranges, and the waves there; the generator goes on behind them."""
    rng = np.random.default_rng(seed)
    x, u = rng.uniform(-1.0, 1.0, (2, count))
    found = smooth_force_columns(motion(0.2 + 0.5 * x, 2.0 * u), np.sign(u), RANGES)
    waves = np.stack([values for name, values in found.items() if name[0] == NAME], axis=1)
    return rng, x, u, waves


def dense(
    target: Samples, columns: Sequence[tuple[Samples, float]], waves: Samples, sigma: float
) -> tuple[float, float]:
    """The same by dense covariances s² (V + k² P P' + X D X'), s of the largest likelihood, at least 1.

    Also s² at the level of the largest.
    """
    values, spreads = [], []
    for length in smooth_force.LENGTHS:
        shapes = waves * np.sqrt(smooth_waves.spectrum(length))
        shapes /= math.sqrt((shapes**2).sum() / sigma**2 / len(target))
        for level in smooth_force.LEVELS:
            covariance = sigma**2 * np.eye(len(target)) + level**2 * shapes @ shapes.T
            for column, std in columns:
                covariance += std**2 * np.outer(column, column)
            left = float(target @ np.linalg.solve(covariance, target)) / len(target)
            spreads.append(max(left, 1.0))
            values.append(multivariate_normal.logpdf(target, cov=spreads[-1] * covariance))
    return float(np.logaddexp.reduce(values)) - math.log(len(values)), spreads[int(np.argmax(values))]


def size_of(column: Samples, target: Samples, model: Samples) -> float:
    """Strength at which what is new in a column explains as much as a model leaves."""
    new, left = (y - model @ np.linalg.lstsq(model, y, rcond=None)[0] for y in (column, target))
    return float(np.linalg.norm(left) / np.linalg.norm(new))


@pytest.mark.parametrize("strength", [0.0, 0.4, 4.0])
@pytest.mark.parametrize("stated", [1.0, 0.02], ids=["noise as stated", "noise stated far too small"])
def test_evidence_is_that_of_dense_normal_distributions(strength: float, stated: float) -> None:
    count, sigma = 60, 0.3
    rng, x, u, waves = visited(8, count)
    columns = {OFFSET: np.ones(count), FREE: x, OWN: np.cos(5.0 * x), DRAG: -u * np.abs(u)}
    target = 0.7 + strength * columns[DRAG] + 0.5 * np.sin(2.0 * x + u) + 0.4 * columns[OWN]
    target += sigma * rng.normal(size=count)
    sigma *= stated
    priors = {OFFSET: NumberPrior(0.0, 0.5), FREE: NumberPrior(0.0, math.inf)}
    force = SmoothForce(
        rows_of(target, columns, waves, sigma), np.ones(count, dtype=bool), count, priors, frozenset()
    )
    nuisances = np.stack([columns[OFFSET], columns[FREE]], axis=1)
    model = np.column_stack([nuisances, columns[OWN]])
    free = smooth_force.NUISANCE_STD * math.sqrt(target @ target / (x @ x))
    base = [
        (columns[OFFSET], 0.5),
        (columns[FREE], free),
        (columns[OWN], size_of(columns[OWN], target, nuisances)),
    ]
    _, spread = dense(target, base, waves, sigma)
    base = [(column, std / math.sqrt(spread)) for column, std in base]
    without, _ = dense(target, base, waves, sigma)
    need = force.beside([OFFSET, FREE, OWN])
    for share in (1.0, 0.1):
        std = share * size_of(columns[DRAG], target, model) / math.sqrt(spread)
        expected, _ = dense(target, [*base, (columns[DRAG], std)], waves, sigma)
        assert need([DRAG], share) == pytest.approx(expected - without, abs=1e-6)


def test_a_strength_that_may_not_be_negative() -> None:
    """Of the term there is no evidence then; of a model's own it is as without that column."""
    count = 80
    rng, x, u, waves = visited(2, count)
    columns = {OFFSET: np.ones(count), DRAG: -u * np.abs(u), FREE: np.sign(x) * u}
    target = -3.0 * columns[DRAG] + columns[FREE] + 0.1 * rng.normal(size=count)
    force = SmoothForce(
        rows_of(target, columns, waves, 0.1),
        np.ones(count, dtype=bool),
        count,
        {OFFSET: NumberPrior(0.0, math.inf)},
        frozenset([DRAG]),
    )
    assert force.beside([OFFSET])([DRAG], 1.0) == -math.inf
    assert force.beside([OFFSET, DRAG])([FREE], 1.0) == pytest.approx(force.beside([OFFSET])([FREE], 1.0))


def test_a_nuisance_of_which_no_row_knows_anything_changes_nothing() -> None:
    """As the gain of a force that is zero all along."""
    count = 80
    rng, _, u, waves = visited(2, count)
    columns = {OFFSET: np.ones(count), FREE: np.zeros(count), DRAG: -u * np.abs(u)}
    target = columns[DRAG] + 0.1 * rng.normal(size=count)
    priors = {OFFSET: NumberPrior(0.0, math.inf), FREE: NumberPrior(0.0, math.inf)}
    force = SmoothForce(
        rows_of(target, columns, waves, 0.1), np.ones(count, dtype=bool), count, priors, frozenset()
    )
    need = force.beside([OFFSET])([DRAG], 1.0)
    assert need > 3.0
    assert force.beside([OFFSET, FREE])([DRAG], 1.0) == pytest.approx(need)
    assert force.beside([OFFSET])([FREE], 1.0) == pytest.approx(0.0)


@pytest.fixture(scope="module")
def nothing_but_a_smooth_force() -> MachineFinding:
    return investigate_machine(slide(wandering, 4), SLIDE)


def test_a_smooth_force_alone_has_no_name(nothing_but_a_smooth_force: MachineFinding) -> None:
    found = nothing_but_a_smooth_force
    assert found.fall.before > 1.5
    assert found.verdict == "unknown"
    assert not found.established


def test_it_is_the_smooth_force_that_refuses_the_term_that_closes_most(
    nothing_but_a_smooth_force: MachineFinding,
) -> None:
    step = nothing_but_a_smooth_force.steps[0]
    assert step.reason == SMOOTH_FORCE
    assert step.trials[0].z > 3.0
    assert max(step.needs.values()) < MIN_NEED


def test_the_report_says_how_much_records_need_each_term(
    nothing_but_a_smooth_force: MachineFinding, tmp_path: Path
) -> None:
    step = nothing_but_a_smooth_force.steps[0]
    write_machine_findings(nothing_but_a_smooth_force, slide(wandering, 4), tmp_path / "found", "slide")
    told = sorted(map(format_need, step.needs.values()))
    row = r'<tr[^>]*><td>[^<]*</td>(?:<td class="n">[^<]*</td>){2}<td class="n">([^<]+)</td></tr>'
    for name, point in (("report.html", "."), ("report.de.html", ",")):
        page = (tmp_path / "found" / name).read_text(encoding="utf-8")
        assert sorted(number.replace(point, ".") for number in re.findall(row, page)) == told


@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("viscous_friction", lambda q, v: -0.8 * v),
        ("hardening_spring", lambda q, v: -180.0 * q**3),
        ("stribeck_friction", lambda q, v: -1.5 * np.exp(-((v / 0.06) ** 2)) * np.sign(v)),
    ],
)
def test_a_term_beside_a_smooth_force_is_named(name: str, law: Law) -> None:
    found = investigate_machine(slide(lambda q, v: law(q, v) + wandering(q, v), 5), SLIDE)
    assert found.established == (name,)
    assert found.fall.after < found.fall.before


def test_a_function_in_one_place_is_told_from_a_smooth_force() -> None:
    """A bump of friction along the stroke is no term of the catalogue, and no smooth force."""

    def bump(q: Samples, v: Samples) -> Samples:
        return -1.5 * np.exp(-0.5 * ((q - 0.04) / 0.05) ** 2) * np.sign(v)

    found = investigate_machine(slide(bump, 6), SLIDE)
    assert not found.established
    assert found.law is not None
    assert found.law.place == "law_of_friction_over_position"


def test_a_spring_that_saturates_is_not_one_that_softens_by_the_cube() -> None:
    """A cube closes nine tenths of it, and records need a function of the position much more."""
    found = investigate_machine(slide(lambda q, v: -1.5 * np.tanh(q / 0.04), 6), SLIDE)
    assert "hardening_spring" not in found.established
    assert found.law is not None
    assert found.law.place == "law_of_force_over_position"
    assert found.law.fall.after < 1.2
