"""Parts of the search for a law by themselves: covariates, their range, how a spline bends."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.discrepancy.data.phases import PHASES
from impactcell.discrepancy.laws import covariates, finding, grammar, refit
from impactcell.discrepancy.laws.condense import RankedForm
from impactcell.discrepancy.laws.grammar import Shaped
from impactcell.discrepancy.laws.law import LawParameter, write_law
from impactcell.discrepancy.model.parameters import effect_coordinates
from impactcell.discrepancy.search.effect_grid import VisitedRange, effect_grid
from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, ParameterKind, Phase
from impactcell.physics.effects import LIBRARY, offer_effect, withdraw_effect
from impactcell.physics.free_forms import FREE_FORMS
from impactcell.physics.outside_effects import offer_effects


def test_covariates_of_a_law_are_the_motions_own_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    n = 400
    rng, sliding = np.random.default_rng(1), PHASES.index("loading")
    trajectory = SimpleNamespace(
        speed_m_s=rng.uniform(0.0, 0.2, n),
        part_displacement_m=rng.uniform(0.0, 1e-3, n),
        actuator_displacement_m=rng.uniform(1e-3, 3e-3, n),
    )
    items = [
        SimpleNamespace(velocity_m_s=0.3, direction=1, start_m=0.0),
        SimpleNamespace(velocity_m_s=0.5, direction=1, start_m=0.0),
    ]
    shots = SimpleNamespace(
        items=items,
        channel=np.arange(n) % 2,
        values=rng.uniform(10.0, 90.0, n),
        times=np.linspace(0.0, 1.0, n),
    )
    problem: Any = SimpleNamespace(shots=shots, sizes=np.array([150, 250]))
    model: Any = None
    monkeypatch.setattr(covariates, "trajectory_of", lambda *_: trajectory)
    monkeypatch.setattr(covariates, "sample_phases", lambda *_: np.full(n, sliding))
    forms = {form.covariate: form for form in FREE_FORMS.values() if not form.is_between_shots}
    strikes = np.repeat([0.3, 0.5], [150, 250])
    expected = {
        "speed": trajectory.speed_m_s,
        "indentation_rate": strikes - trajectory.speed_m_s,
        "force": shots.values[shots.channel == 0],
        "indentation": trajectory.actuator_displacement_m - trajectory.part_displacement_m,
    }
    assert len(expected.keys() & forms.keys()) > 2
    for name in expected.keys() & forms.keys():
        met = covariates.visited(problem, model, forms[name])
        assert met is not None
        assert met.values == pytest.approx(expected[name])
        assert met.upper == pytest.approx(expected[name].max())


@pytest.mark.parametrize(("lowest", "is_enough"), [(0.5, True), (0.78, True), (0.82, False)])
def test_what_varies_by_less_than_a_fifth_was_not_gone_through(lowest: float, is_enough: bool) -> None:
    form: Any = SimpleNamespace(covariate="position")
    assert (covariates._range(np.linspace(lowest, 1.0, 80), form) is not None) is is_enough


def test_a_range_that_begins_at_nought_has_the_atoms_of_positive_numbers() -> None:
    def names(lower: float) -> set[str]:
        return {
            item.term[0].name
            for item in grammar.shaped_terms(lower, 2.0, constant=True)
            if len(item.term) == 1
        }

    assert names(0.0) == names(0.5)
    assert names(-0.5) < names(0.0)


@pytest.mark.parametrize("smoothness", finding.SMOOTHNESS)
def test_only_the_smoothest_spline_tells_nothing_of_how_a_term_bends(
    monkeypatch: pytest.MonkeyPatch, smoothness: float
) -> None:
    monkeypatch.setattr(finding, "gives_energy", lambda *_: False)
    form = SimpleNamespace(covariates=("speed",), second="", effect=SimpleNamespace(equation="s(v)"))
    term: Any = SimpleNamespace(smoothness=smoothness, form=form)
    change = change_of_gap(4.0, 1.0)
    said = finding._refusal(term, None, change, 2.0)
    assert bool(said) is (smoothness == max(finding.SMOOTHNESS))
    law: Any = SimpleNamespace(function=None)
    assert finding._refusal(term, law, change, 2.0) == ""


@pytest.mark.parametrize(
    ("before", "after", "falls"),
    [(1.05, 1.03, True), (1.05, 1.01, False), (1.4, 1.19, False), (1.4, 1.21, True), (6.0, 1.19, False)],
)
def test_what_leaves_most_of_a_small_gap_is_not_the_law_that_is_missing(
    monkeypatch: pytest.MonkeyPatch, before: float, after: float, falls: bool
) -> None:
    monkeypatch.setattr(finding, "gives_energy", lambda *_: False)
    form = SimpleNamespace(covariates=("time",), second="", effect=SimpleNamespace(equation="s(t)"))
    term: Any = SimpleNamespace(smoothness=1e-4, form=form)
    said = finding._refusal(term, None, change_of_gap(before, after), finding.MOST_LEFT)
    assert bool(said) is falls
    assert falls is (f"leaves {after:.3g} of {before:.3g} noise floors" in said)


def change_of_gap(before: float, after: float) -> Any:
    told = [SimpleNamespace(of=lambda _, value=value: value) for value in (before, after)]
    return SimpleNamespace(is_real=lambda: True, before=told[0], after=told[1], parts=())


def test_a_value_past_the_end_of_its_range_by_rounding_begins_at_the_end() -> None:
    scale = LawParameter("scale_m_s", "m/s", np.nan, 1e-3, 1.0, 0.1)
    assert scale.starting_at(np.nextafter(scale.lower, 0.0)).first == scale.lower
    assert scale.starting_at(1.0 + 1e-15).first == scale.upper
    assert scale.starting_at(0.3).first == 0.3


def test_a_wave_has_no_parts_to_be_tried_alone() -> None:
    """Its two terms share one period: taken apart as a sum, the search ended in a traceback."""
    place = next(form for form in FREE_FORMS.values() if form.covariate == "position")
    terms = tuple(Shaped((atom,), ((0.004,),)) for atom in grammar.WAVE_ATOMS)
    ranked = RankedForm(terms, (0.02, 0.01), 50.0, 40.0, np.zeros(2))
    law = write_law(place, ranked, ((0.0, 0.02),))
    assert law.is_wave
    coordinates = [SimpleNamespace(value=lambda number: number) for _ in law.parameters]
    fit = SimpleNamespace(coordinates=coordinates, theta=np.array([one.first for one in law.parameters]))
    fitted: Any = SimpleNamespace(law=law, ranked=ranked, fit=fit)
    nothing: Any = None
    assert refit._parts_alone(nothing, fitted) == []


@pytest.mark.parametrize(("amplitude", "centre"), [(0.02, 0.0), (0.02, 1e-19), (0.0, 0.004)])
def test_a_law_that_begins_at_nought_moves_on_the_scale_of_its_range(amplitude: float, centre: float) -> None:
    """Something in the middle of the places gone through: the fit ended in a division by its typical 0."""
    place = next(form for form in FREE_FORMS.values() if form.covariate == "position" and form.is_factor)
    atom = next(one for one in grammar.ATOMS if grammar.CENTRE in one.shapes)
    shapes = tuple(centre if shape is grammar.CENTRE else 0.002 for shape in atom.shapes)
    ranked = RankedForm((Shaped((atom,), (shapes,)),), (amplitude,), 50.0, 40.0, np.zeros(2))
    law = write_law(place, ranked, ((-0.01, 0.01),))
    law.effect()
    for coordinate, parameter in zip(
        effect_coordinates(law.identifier, batches=1), law.parameters, strict=True
    ):
        start = coordinate.coordinate(parameter.first)
        assert coordinate.value(start) == pytest.approx(parameter.first)
        assert coordinate.lower <= start <= coordinate.upper
        assert max(abs(coordinate.lower), abs(coordinate.upper)) <= 1e4


def test_a_law_that_was_given_and_is_found_once_more_has_another_name(tmp_path: Path) -> None:
    """The run with the law file that the one before wrote ended after minutes: the name was taken."""
    place = next(form for form in FREE_FORMS.values() if form.covariate == "position" and form.is_factor)
    atom = next(one for one in grammar.ATOMS if grammar.CENTRE in one.shapes)
    shapes = tuple(0.00412 if shape is grammar.CENTRE else 0.0021 for shape in atom.shapes)
    ranked = RankedForm((Shaped((atom,), (shapes,)),), (0.0234,), 50.0, 40.0, np.zeros(2))
    given = write_law(place, ranked, ((-0.01, 0.01),))
    (tmp_path / f"{given.identifier}.py").write_text(given.text(), encoding="utf-8")
    offer_effects([tmp_path])
    try:
        found = write_law(place, ranked, ((-0.01, 0.01),))
        assert found.effect().identifier == found.identifier == f"{given.identifier}_2"
        assert LIBRARY[given.identifier] is not found.effect()
    finally:
        withdraw_effect(given.identifier)
    assert write_law(place, ranked, ((-0.01, 0.01),)).identifier == given.identifier


def test_a_law_that_was_given_is_tried_as_it_was_given() -> None:
    """Of a sum of two terms each was tried alone, at places on the table: it was found anew beside itself."""
    given = Effect(
        identifier="two_terms",
        kind=Kind.CONTACT,
        equation="d s(d)",
        reference="a test",
        phases=(Phase.LOADING,),
        parameters=(
            Parameter("amplitude_1_n_per_m", "N/m", null=0.0, lower=-1e8, upper=1e8, typical=-2.7e5),
            Parameter("scale_m", "m", null=math.nan, lower=1e-6, upper=0.07, typical=5.8e-5),
            Parameter("amplitude_2_n_per_m", "N/m", null=0.0, lower=-1e8, upper=1e8, typical=5.5e4),
            Parameter("centre_m", "m", math.nan, 1e-6, 7e-4, 6.5e-5, kind=ParameterKind.POSITION),
        ),
        laws={LawKind.CONTACT: lambda a, _b, _c, _d, p: a * p[0] + p[2]},
    )
    offer_effect(given)
    try:
        grid = effect_grid("two_terms", 1, VisitedRange(0.0, 5e-3, 0.1))
        coordinates = effect_coordinates("two_terms", 1)
    finally:
        withdraw_effect("two_terms")
    whole = [point for point in grid if not point.scaled]
    assert len(whole) == 1
    values = [one.value(float(at)) for one, at in zip(coordinates, whole[0].theta, strict=True)]
    assert values == pytest.approx([-2.7e5, 5.8e-5, 5.5e4, 6.5e-5])
    assert all(point.scaled for point in effect_grid("friction_patch", 1, VisitedRange(0.0, 5e-3, 0.1)))
