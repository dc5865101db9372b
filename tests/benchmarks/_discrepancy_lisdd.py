"""LISDD on the same shots: find where the nominal model fails, add a sparse term there, certify it on others.

Built from the abstract of Y. Wang, Where Is My Physics Wrong? Localized and Identifiable Discovery of Model
Discrepancy, arXiv:2606.23215 (2026); the text beyond it was not at hand. Taken from there:

- the known physics is fitted on a clean regime that is found automatically;
- regimes are flagged by a calibrated residual energy, errors being independent and Gaussian;
- the missing term of a flagged regime is chosen by exhaustive holdout over a library of candidates;
- it is certified by a sample-split F test, with the false discovery rate controlled over regimes.

Own choices, tried on a dozen campaigns of seeds that no study reports:

- What is regressed are the whitened residuals of the traces, not forces: differentiation would make errors
  neither independent nor of known size. The terms are the derivatives of the traces by the strength of every
  effect, over the grid of its shapes; sine and cosine of a wave are one term.
- Physics are the shared parameters of the plant and every shot's own, linearised about the nominal fit.
- Regimes are the phases, narrowed to half of a covariate where the other half is clean. In a trace what
  happens in one phase is carried on into the next: neighbours that are flagged are one regime.
- Friction factors are a regime of their own. Their scatter is not known beforehand, so it is always
  tested; for effects that show in the traces only where nothing is wrong with those.
- Shots are split in two at random; holdout is by cross-validation within the first half. A regime has one
  term: of a strong effect the linearised term leaves a rest that is certain, and further terms fitted that.
- Effects whose chosen terms can hardly be told apart there are named together, as PySINDy's are.
"""

import numpy as np
from scipy.stats import chi2

from impactcell.discrepancy.data.phases import FREE_SLIDE, LOADING, PRELOAD, STOP, UNLOADING
from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.phase_of_samples import sample_phases, trajectory_of
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.search.candidate_scores import (
    between_shot_factors,
    effect_direction,
    phase_angle_index,
    visited_range,
)
from impactcell.discrepancy.search.effect_grid import effect_grid
from tests.benchmarks._discrepancy_certified import (
    CUT,
    RATE,
    Regime,
    Term,
    below_rate,
    certified,
    halves,
    regime,
)

IN_TIME = (PRELOAD, LOADING, UNLOADING, FREE_SLIDE, STOP)
FEWEST = 20
"""Samples without which a regime is not judged."""
ABSORBED = 0.9
"""Share of a term that the friction factors can do: it is one of theirs."""


def lisdd(problem: Problem, nominal: Fit, library: tuple[str, ...]) -> list[list[str]]:
    """Effects that LISDD names, those with the same term together."""
    traces, factors = candidates(problem, nominal, library)
    first = halves(problem.count)
    whitened = Whitened(problem, nominal)
    found = [whitened.regime(rows, traces) for rows in whitened.flagged(first)]
    names = [term for term in factors if not found or not any(term[0] == other[0] for other, _ in traces)]
    level = np.ones(1)
    logs = nominal.shot_parameters.log_factor
    parts = [
        (logs[i : i + 1], level[None], np.array([[factors[term][i] for term in names]]), 0)
        for i in range(problem.count)
    ]
    return certified([*found, regime(parts, names)], first)


def candidates(
    problem: Problem, fit: Fit, library: tuple[str, ...]
) -> tuple[dict[tuple[Term, int], np.ndarray], dict[Term, np.ndarray]]:
    """Terms of the traces, shape (N,) a column, and of the logarithms of the friction factors, shape (n,)."""
    visited = visited_range(problem, fit)
    by_factor = problem.with_effects(fit.effects).shot_jacobian(fit.state, central=True)[0]
    starts = problem.shots.bounds[:-1]
    squared = np.maximum(np.add.reduceat(by_factor**2, starts), 1e-300)
    traces: dict[tuple[Term, int], np.ndarray] = {}
    factors: dict[Term, np.ndarray] = {}
    for effect in library:
        grid = effect_grid(effect, problem.batches, visited)
        angle = phase_angle_index(effect)
        for number, point in enumerate(grid):
            between = between_shot_factors(problem, effect, point)
            if between is not None:
                factors[effect, str(number)] = between
                continue
            change = effect_direction(problem, fit, effect, point, is_single=len(grid) == 1)
            if change is None or not change.any():
                continue
            along = np.add.reduceat(change * by_factor, starts)
            if np.sum(along**2 / squared) > ABSORBED * float(change @ change):
                factors[effect, str(number)] = along / squared
            shape = point.theta if angle is None else np.delete(point.theta, angle)
            term = (effect, " ".join(f"{one:.6g}" for one in shape))
            traces[term, number] = change / np.linalg.norm(change)
    return traces, factors


class Whitened:
    """Residuals of all traces, with what says where and when each sample is."""

    def __init__(self, problem: Problem, fit: Fit) -> None:
        model = problem.with_effects(fit.effects)
        self.count = problem.count
        self.residual = fit.residual
        self.own = model.shot_jacobian(fit.state, central=True).T
        self.shared = model.shared_jacobian(fit.state).T
        self.shot = np.repeat(np.arange(problem.count), np.diff(problem.shots.bounds))
        trajectory = trajectory_of(problem, fit)
        self.phase = sample_phases(problem, trajectory)
        items = problem.shots.items
        each = {
            "velocity": [shot.velocity_m_s for shot in items],
            "mass": [shot.mass_kg for shot in items],
            "direction": [float(shot.direction) for shot in items],
            "order": [float(shot.record) for shot in items],
            "batch": [float(shot.batch) for shot in items],
            "dwell": [shot.dwell_s for shot in items],
            "start": [shot.start_m for shot in items],
        }
        self.covariates = {name: np.array(values)[self.shot] for name, values in each.items()}
        place = self.covariates["start"] + self.covariates["direction"] * trajectory.part_displacement_m
        self.covariates |= {"speed": trajectory.speed_m_s, "place": place}

    def basis(self, rows: np.ndarray, shots: np.ndarray) -> np.ndarray:
        """Orthonormal columns of what the physics can do to some samples of some shots."""
        places = np.flatnonzero(rows & shots[self.shot])
        blocks, shared = [], self.shared[places]
        for number in np.flatnonzero(shots):
            mine = self.shot[places] == number
            block = orthonormal(self.own[places[mine]])
            shared[mine] -= block @ (block.T @ shared[mine])
            wide = np.zeros((len(places), block.shape[1]))
            wide[mine] = block
            blocks.append(wide)
        return np.hstack([*blocks, orthonormal(shared)])

    def flagged(self, shots: np.ndarray) -> list[np.ndarray]:
        """Regimes where too much is left of the residuals once the physics is fitted where it is right."""
        phases = [self.phase == phase for phase in IN_TIME]
        wrong = np.zeros(len(phases), dtype=bool)
        for _ in phases:  # each time the physics is fitted on what is clean by then
            clean = np.any([rows for rows, bad in zip(phases, wrong, strict=True) if not bad], axis=0)
            now = below_rate(np.array([self.excess(rows, clean, shots) for rows in phases]))
            if not np.any(now & ~wrong):
                break
            wrong |= now
            if wrong.all():
                break
        clean = ~np.any(
            [rows for rows, bad in zip(phases, wrong, strict=True) if bad] or [phases[0] & False], 0
        )
        found: list[np.ndarray] = []
        before = False
        for rows, bad in zip(phases, wrong, strict=True):
            if bad and before:
                found[-1] = found[-1] | rows
            elif bad:
                found.append(rows)
            before = (before and not rows.any()) or bool(bad)
        return [clean | self.narrowed(rows, clean, shots) for rows in found]

    def excess(self, rows: np.ndarray, clean: np.ndarray, shots: np.ndarray) -> float:
        """p-value of the residual energy of some samples, beside clean ones."""
        both = (rows | clean) & shots[self.shot]
        if (rows & both).sum() < FEWEST:
            return 1.0
        basis = self.basis(both, shots)
        here = rows[both]
        left = self.residual[both] - basis @ (basis.T @ self.residual[both])
        free = here.sum() - np.sum(basis[here] ** 2)
        return float(chi2.sf(np.sum(left[here] ** 2), free)) if free > 1.0 else 1.0

    def narrowed(self, rows: np.ndarray, clean: np.ndarray, shots: np.ndarray) -> np.ndarray:
        """Half of a regime, if there is a covariate in whose other half nothing is wrong."""
        best = (RATE, rows)
        for values in self.covariates.values():
            middle = 0.5 * (values[rows].min() + values[rows].max())
            pair = rows & (values > middle), rows & ~(values > middle)
            if min((one & shots[self.shot]).sum() for one in pair) < FEWEST:
                continue
            p = [self.excess(one, clean, shots) for one in pair]
            if max(p) > best[0] and min(p) < RATE:
                best = (max(p), pair[int(np.argmin(p))])
        return best[1]

    def regime(self, rows: np.ndarray, terms: dict[tuple[Term, int], np.ndarray]) -> Regime:
        """Regime of some samples, every shot's own numbers projected out."""
        parts = []
        for number in range(self.count):
            places = np.flatnonzero(rows & (self.shot == number))
            block = orthonormal(self.own[places])
            columns = np.column_stack(
                [self.residual[places], self.shared[places], *(one[places] for one in terms.values())]
            )
            columns -= block @ (block.T @ columns)
            p = 1 + self.shared.shape[1]
            parts.append((columns[:, 0], columns[:, 1:p], columns[:, p:], block.shape[1]))
        return regime(parts, [term for term, _ in terms])


def orthonormal(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis of some columns."""
    size = np.linalg.norm(columns, axis=0)
    if not size.any():
        return np.zeros((len(columns), 0))
    left, values, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return np.asarray(left[:, values > CUT * values[0]])
