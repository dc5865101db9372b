"""The study behind the discrepancy workflow's table: its plan, strengths, judgements and rivals."""

import itertools
import json
import math
from collections import Counter
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

from impactcell.physics.effects import LIBRARY
from simulator.effects import LIBRARY as LAWS
from simulator.effects import UNLISTED, check
from tests.benchmarks import _discrepancy_judge as judge
from tests.benchmarks._discrepancy_certified import certified, halves, regime
from tests.benchmarks._discrepancy_plan import CONFOUNDED, EQUIVALENT, calibrated, jobs
from tests.benchmarks._discrepancy_rivals import answered, generous, subset
from tests.benchmarks._discrepancy_run import covered, intervals, rows, study
from tests.benchmarks._discrepancy_sindy import selected
from tests.discrepancy.study import Job, hidden, scenario, strengths

THREE, TIED = ["adhesion", "mass_error", "surface_tilt"], {"hertz_contact": ["mass_error"]}


def row(
    verdict: str, named: list[str], tied: dict[str, list[str]] | None = None, **job: Any
) -> dict[str, Any]:
    return {
        "job": {"kind": "single", "hidden": ["adhesion"], "removed": ""} | job,
        "verdict": verdict,
        "named": named,
        "tied": tied or {},
        "proposals": [],
    }


def test_the_plan_is_large_enough_and_balanced_wherever_it_stops() -> None:
    plan = jobs()
    hidden = [job for job in plan if job.hidden]
    assert len(hidden) >= 300
    assert len(plan) - len(hidden) >= 200
    assert len({job.key for job in plan}) == len(plan)
    assert set(LAWS) == {job.hidden[0] for job in plan if job.kind == "single"}
    assert {job.removed for job in plan if job.kind == "removed"} == set(LAWS)
    in_its_own_study = {"wandering_force", "wedge_drag"}
    assert {job.hidden[0] for job in plan if job.kind == "outside"} == set(UNLISTED) - in_its_own_study
    assert all(set(job.hidden) != CONFOUNDED for job in plan)
    threes = [job for job in jobs(three=80) if job.kind == "three"]
    assert len({job.hidden for job in threes}) == 80
    assert all(len(set(job.hidden)) == 3 for job in threes)
    assert all(len(group & set(job.hidden)) < 2 for job in threes for group in EQUIVALENT)
    assert [job for job in jobs(three=80) if job.kind != "three"] == plan
    whole = Counter(job.kind for job in plan)
    for part in (0.1, 0.3, 0.7):
        first = Counter(job.kind for job in plan[: round(part * len(plan))])
        assert all(abs(first[kind] - part * count) <= 1.5 for kind, count in whole.items())
    none = {(job.shots, job.coloured, job.replicates) for job in plan if job.kind == "none"}
    assert none == set(itertools.product((30, 60, 100), (False, True), (False, True)))


@pytest.mark.parametrize("effect", sorted({**LAWS, **UNLISTED}))
def test_strengths_are_what_the_simulator_and_the_library_call_them(effect: str) -> None:
    for seed in (None, 5):
        made = strengths(effect, 0.4, seed)
        check(
            effect,
            {name: value if isinstance(value, float) else tuple(value) for name, value in made.items()},
        )
        if effect in LIBRARY:
            assert [one.name for one in LIBRARY[effect].parameters] == list(made)


def test_a_strength_is_calibrated_to_the_gap_that_theory_gives() -> None:
    job = Job("single", ("friction_drift",), 8, target=3.0)
    ((multiple,), (gap,)) = calibrated(job)
    scatter = scenario(job).friction_scatter
    # A drift of c over the shots has a variance of c²/12, and the gap (b) is sqrt(1 + variance/scatter²).
    theory = math.sqrt(12.0 * (3.0**2 - 1.0)) * scatter / 0.1
    assert gap == pytest.approx(3.0, rel=0.06)
    assert multiple == pytest.approx(theory, rel=0.2)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (row("named", ["adhesion"]), "right"),
        (row("tied", ["force_sensor_lag"], {"force_sensor_lag": ["adhesion"]}), "tied"),
        (row("named", ["force_sensor_lag"]), "wrong"),
        (row("named", ["adhesion", "force_sensor_lag"]), "wrong"),
        (row("no_gap", []), "no_gap"),
        (row("unknown", []), "unknown"),
        (row("unknown", ["adhesion"]), "unknown"),
        (row("unknown", ["force_sensor_lag"]), "unknown, but"),
        (row("named", ["adhesion"], hidden=["adhesion", "surface_tilt"]), "partial"),
        (row("named", ["surface_tilt", "adhesion"], hidden=["adhesion", "surface_tilt"]), "right"),
        (row("named", ["surface_tilt", "adhesion"], hidden=THREE), "partial"),
        (row("named", ["surface_tilt", "adhesion", "mass_error"], hidden=THREE), "right"),
        (row("tied", ["surface_tilt", "hertz_contact", "adhesion"], TIED, hidden=THREE), "tied"),
        (
            row("named", ["channel_skew"], hidden=["force_sensor_lag"], removed="force_sensor_lag"),
            "equivalent",
        ),
        (row("named", ["adhesion"], hidden=["force_sensor_lag"], removed="force_sensor_lag"), "wrong"),
        (row("unknown", [], hidden=["force_sensor_lag"], removed="force_sensor_lag"), "unknown"),
        (row("named", ["adhesion"], kind="none", hidden=[]), "wrong"),
        (row("unknown", [], kind="outside", hidden=["loose_mass"]), "unknown"),
    ],
)
def test_answers_are_judged(given: dict[str, Any], expected: str) -> None:
    assert judge.judged(given) == expected


def test_one_tie_cannot_stand_for_two_hidden_effects() -> None:
    given = row(
        "tied",
        ["adhesion", "mass_error"],
        {"adhesion": ["surface_tilt"]},
        hidden=["adhesion", "surface_tilt"],
    )
    assert judge.judged(given) == "wrong"


def test_an_exact_confound_needs_both_names_and_a_way_out() -> None:
    given = row("tied", ["mass_error"], {"mass_error": ["force_sensor_gain"]}, hidden=["mass_error"])
    assert not judge.confound_said(given)
    assert judge.confound_said(given | {"proposals": [["mass_error", "force_sensor_gain"]]})
    assert not judge.confound_said(given | {"tied": {}, "proposals": [["mass_error", "force_sensor_gain"]]})


def test_every_unlisted_law_has_its_phases() -> None:
    assert set(judge.ACTS) == set(UNLISTED)


def test_intervals_are_wilsons() -> None:
    for count, total in ((0, 20), (8, 10), (200, 200)):
        truth = binomtest(count, total).proportion_ci(method="wilson")
        assert judge.wilson(count, total) == f"{100 * truth.low:.1f}-{100 * truth.high:.1f} %"


def test_intervals_are_held_against_the_truth() -> None:
    job = Job("two", ("periodic_friction", "batch_shift"), 4)
    truth = strengths("periodic_friction", 1.0)
    plant = scenario(job).plant
    known = {
        "stiffness_n_per_m": plant.stiffness_n_per_m,
        "damping_n_s_per_m": plant.damping_n_s_per_m,
        "mu_k": plant.mu_s * plant.ratio,
        "ratio": 1.0 / plant.ratio,
    }

    def around(value: float, off: float = 0.0) -> dict[str, Any]:
        return {"value": value, "ci95": [value + off - 1e-3, value + off + 1e-3]}

    periodic = {name: around(value) for name, value in truth.items() if isinstance(value, float)}
    periodic["phase_rad"] = around(float(truth["phase_rad"]), 2.0 * math.pi)  # type: ignore[arg-type]
    outcome = {
        "effects": [
            {"effect": "periodic_friction", "parameters": periodic},
            {
                "effect": "batch_shift",
                "parameters": {"relative_change": {"value": [0.1], "ci95": [[0.09, None]]}},
            },
            {"effect": "adhesion", "parameters": {}},
        ],
        "nominal": {name: around(value, 0.1 * (name == "mu_k")) for name, value in known.items()},
    }
    found = covered(job, (1.0, 1.0), outcome)
    assert found == {"effects": [True, True, True, False], "nominal": [True, True, False, True]}


def test_rivals_that_know_no_ties_are_forgiven_the_exact_confound() -> None:
    given = {"job": {"kind": "single", "hidden": ["mass_error"], "removed": ""}}
    assert judge.judged(generous(answered(given, [["force_sensor_gain"]]))) == "right"
    assert judge.judged(generous(answered(given, [["adhesion"]]))) == "wrong"
    assert judge.judged(generous(answered(given, []))) == "no_gap"


@pytest.mark.slow
def test_a_sparse_regression_names_the_terms_that_are_there() -> None:
    rng = np.random.default_rng(1)
    shots = []
    for _ in range(12):
        columns = {("", "level"): np.ones(60)} | {
            (name, "term"): rng.standard_normal(60)
            for name in ("adhesion", "viscous_friction", "surface_tilt")
        }
        noise = 0.1 * rng.standard_normal(60)
        shots.append((5.0 - 2.0 * columns["viscous_friction", "term"] + noise, columns))
    assert selected(shots) == ["viscous_friction"]


@pytest.mark.slow
def test_localised_discovery_certifies_the_term_that_is_there_and_controls_what_it_names_in_noise() -> None:
    rng = np.random.default_rng(3)
    names = [
        (name, str(point)) for name in ("adhesion", "viscous_friction", "surface_tilt") for point in range(2)
    ]
    first = halves(12)
    false = 0
    for strength in [0.0] * 300 + [0.5] * 5:
        places = []
        for place in range(2):
            parts = []
            for _ in range(12):
                physics, terms = rng.standard_normal((60, 2)), rng.standard_normal((60, len(names)))
                here = strength * terms[:, 2] if place else 0.0
                parts.append((physics @ [5.0, -1.0] + here + rng.standard_normal(60), physics, terms, 0))
            places.append(regime(parts, names))
        found = certified(places, first)
        if strength:
            assert ["viscous_friction"] in found
            assert len(found) <= 2
        else:
            false += bool(found)
    assert 1 <= false <= 27  # of 300 at most 5 %: 15, and three standard deviations


def test_a_study_goes_on_where_it_was(tmp_path: Any) -> None:
    plan = [Job("none", (), seed) for seed in range(3)]
    file = tmp_path / "rows.jsonl"
    file.write_text(json.dumps({"key": plan[1].key}) + "\n")
    study(file, plan, 1, _only_key)
    found = rows(file)
    assert [one["key"] for one in found] == [plan[1].key, plan[0].key, plan[2].key]
    assert [one.get("error") for one in found] == [None, None, "ZeroDivisionError: of this campaign"]
    assert judge.judged(found[2]) == "error"


def _only_key(job: Job) -> dict[str, Any]:
    if job.seed == 2:
        raise ZeroDivisionError("of this campaign")
    return {"key": job.key}


def test_a_later_plan_has_the_same_campaigns_of_seeds_never_seen_and_three_effects_where_asked() -> None:
    plan, later = jobs(), jobs(later=8_000_000, three=12)
    assert not {job.seed for job in plan} & {job.seed for job in later}
    assert Counter(job.kind for job in later) == Counter(job.kind for job in plan) + Counter(three=12)
    threes = [job.hidden for job in later if job.kind == "three"]
    assert all(len(set(three)) == 3 and not set(three) >= CONFOUNDED for three in threes)
    assert len(set(threes)) == 12


def test_a_row_keeps_truth_estimate_and_interval_of_what_was_rightly_named() -> None:
    job = Job("single", ("restoring_force",), 1, strength=2.0)
    ((name, truth),) = hidden(job, (2.0,))["restoring_force"].items()
    numbers = {name: {"value": 230.0, "ci95": [210.0, 250.0]}}
    outcome = {
        "effects": [
            {"effect": "restoring_force", "parameters": numbers},
            {"effect": "friction_patch", "parameters": {}},
        ]
    }
    assert intervals(job, (2.0,), outcome) == [["restoring_force", name, truth, 230.0, [210.0, 250.0]]]


def test_rivals_get_every_third_campaign_of_each_kind_with_its_strengths() -> None:
    plan = jobs(single=1, subtle=1, removed=1, outside=1, two=6, none=9)
    found = [{"key": job.key, "multiples": [0.5] * len(job.hidden)} for job in plan if job.seed != 60_003]
    tasks = subset(plan, found)
    kinds = Counter(task.job.kind for task in tasks)
    assert kinds == {"single": 9, "subtle": 9, "removed": 9, "outside": 3, "two": 2, "none": 2}
    assert all(task.multiples == (0.5,) * len(task.job.hidden) for task in tasks)
