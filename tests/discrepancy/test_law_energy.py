"""What a dissipative law may give of energy before it is refused: what its fit leaves open, and no more."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.discrepancy.laws import fitted_function
from impactcell.discrepancy.laws.covariates import Visited
from impactcell.discrepancy.laws.fitted_function import BAND, gives_energy
from impactcell.discrepancy.laws.free_term import FreeTerm
from impactcell.discrepancy.laws.refit import FittedLaw
from impactcell.discrepancy.model import Fit
from impactcell.discrepancy.model.shot_parameters import ShotParameters
from impactcell.physics.free_forms import FREE_FORMS
from impactcell.physics.free_pair_forms import FREE_PAIR_FORMS
from impactcell.records import Samples

NOISE_N = 0.3
"""Of a force [N], by which the function is known."""
STATES = 3000
FRICTION_N = 0.7
"""Force that friction may have taken from a drag, where a fit has not come to rest [N]."""
DRAG = FREE_PAIR_FORMS["free_drag_over_speed_and_position"]
FRICTION = FREE_FORMS["free_friction_over_speed"]


def coordinate(effect: str, name: str) -> Any:
    return SimpleNamespace(
        effect=effect, parameter=name, batch=0, form="linear", scale=1.0, value=lambda number: number
    )


def fit_of(coordinates: list[Any], theta: Samples) -> Fit:
    nothing = ShotParameters(*np.zeros((7, 1)))
    return Fit((), tuple(coordinates), theta, nothing, 1.0, np.zeros(1))


class KnownDrag:
    """Drag over speed and position as forces of known noise tell it, the equations of the fit being these."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, seed: int = 3) -> None:
        rng = np.random.default_rng(seed)
        self.points = rng.uniform([0.0, -0.006], [0.2, 0.006], (STATES, 2))
        self.speed, self.position = self.points.T
        second = Visited(-0.006, 0.006, self.position)
        self.visited = Visited(0.0, 0.2, self.speed, second, self.speed**2)
        self.coordinates = [coordinate(DRAG.effect.identifier, name) for name in DRAG.coefficients]
        self.basis = self.term(np.zeros(len(self.coordinates))).basis(self.points)
        self.rows = self.speed[:, None] * self.basis / NOISE_N
        self.information = self.rows.T @ self.rows
        self.gradient = np.zeros(len(self.coordinates))
        self.noise = rng.standard_normal(STATES)
        monkeypatch.setattr(fitted_function, "equations", lambda *_: (self.information, self.gradient))

    def term(self, theta: Samples) -> FreeTerm:
        problem: Any = SimpleNamespace(penalty_matrix=1e-12 * np.eye(theta.size))
        return FreeTerm(DRAG, self.visited, problem, fit_of(self.coordinates, theta), 1e-6, np.empty(0))

    def coefficients(self, drag: Samples) -> Samples:
        """Fit a drag [N s/m] that is known with the noise of the forces."""
        found: Samples = np.linalg.lstsq(self.rows, self.speed * drag / NOISE_N + self.noise)[0]
        return found

    def share_below_band(self, theta: Samples) -> float:
        """Share of the states at which the drag is below its own band: by chance a fortieth at most."""
        std = np.sqrt(np.einsum("nk,kl,nl->n", self.basis, np.linalg.inv(self.information), self.basis))
        return float(np.mean(self.basis @ theta + BAND * std < 0.0))


def test_a_drag_of_which_friction_holds_a_part_is_not_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The true drag takes energy everywhere, but the fit has not come to rest."""
    known = KnownDrag(monkeypatch)
    rest = known.coefficients(60.0 / (1.0 - known.position / 0.025))
    taken = np.linalg.lstsq(known.rows, np.full(STATES, FRICTION_N / NOISE_N))[0]
    known.gradient = known.information @ taken
    assert known.share_below_band(rest - taken) > 0.025
    assert not gives_energy(known.term(rest - taken))


@pytest.mark.parametrize("seed", range(5))
def test_a_drag_that_vanishes_somewhere_is_not_refused_for_its_noise(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    known = KnownDrag(monkeypatch, seed)
    theta = known.coefficients(15.0 * (1.0 + known.position / 0.006) ** 2)
    assert (known.basis @ theta < 0.0).any()
    assert not gives_energy(known.term(theta))


@pytest.mark.parametrize("rests", [True, False])
def test_a_drag_that_pushes_where_a_quarter_of_the_states_are_is_refused(
    monkeypatch: pytest.MonkeyPatch, *, rests: bool
) -> None:
    known = KnownDrag(monkeypatch)
    theta = known.coefficients(15.0 - 15.0 * known.position / 0.003)
    if not rests:
        taken = np.linalg.lstsq(known.rows, np.full(STATES, FRICTION_N / NOISE_N))[0]
        known.gradient, theta = known.information @ taken, theta - taken
    assert gives_energy(known.term(theta))


@pytest.mark.parametrize(("least", "gives"), [(0.02, False), (-0.02, True)])
def test_friction_is_the_sum_of_the_law_and_the_plants_own_of_the_same_fit(
    monkeypatch: pytest.MonkeyPatch, least: float, *, gives: bool
) -> None:
    """A law and the plant's friction share a constant, each fit in its own way."""
    speed = np.linspace(0.0, 0.2, STATES)
    visited = Visited(0.0, 0.2, speed, None, speed)
    problem: Any = SimpleNamespace(penalty_matrix=np.zeros((2, 2)))
    of_spline = fit_of([coordinate("", "mu_k")], np.array([0.05]))
    term = FreeTerm(FRICTION, visited, problem, of_spline, 1.0, np.empty(0))
    text: Any = SimpleNamespace(identifier="law_of_it", expression="slope * u", parameters=("slope",))
    fitted = fit_of(
        [coordinate("", "mu_k"), coordinate("law_of_it", "slope")], np.array([0.2, 5 * least - 1.0])
    )
    law = FittedLaw(text, SimpleNamespace(), problem, fitted, 0.0, np.empty(0))  # type: ignore[arg-type]
    rows = np.column_stack([np.ones(STATES), speed]) / 0.05
    monkeypatch.setattr(fitted_function, "equations", lambda *_: (rows.T @ rows, np.zeros(2)))
    assert law.function(speed[-1:])[0] + 0.2 == pytest.approx(least)
    assert gives_energy(term, law) is gives


def test_what_need_not_dissipate_may_give_energy() -> None:
    term: Any = SimpleNamespace(form=FREE_FORMS["free_force_over_position"])
    assert not gives_energy(term)
