"""Runs the study of laws that nobody had listed: a row of a file for each campaign, resumable.

`python -m tests.benchmarks._laws_run --turns 2 --budget 300` adds the campaigns that are not there yet,
balanced over what is hidden, and stops after 300 s of processor time; `--only none` takes those with nothing
hidden, any other name those with that effect, `--from 50` begins with a later turn, and `--alone` leaves the
rivals out, which take most of the time.
"""

import argparse
import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.discrepancy.data import prepare, sensor_noise, shot_set
from impactcell.discrepancy.laws import LawFinding
from impactcell.discrepancy.laws.covariates import visited
from impactcell.discrepancy.model import Problem, refit_shot_parameters
from impactcell.discrepancy.search import GapMeasure, Part
from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from impactcell.physics import LawKind
from impactcell.physics.bspline import spline_basis
from impactcell.physics.effects import LIBRARY
from impactcell.records import Samples
from simulator.campaign import make
from simulator.campaign_scenario import CampaignScenario
from tests.benchmarks._laws_rivals import compare
from tests.discrepancy.study import Job, campaign, hidden, recorded, scenario

ROWS = Path("bench-results/laws.jsonl")
FIRST_SEED = 90_000
"""Seeds of this study; numbers were chosen on seeds below 9000."""
SHOTS = 48
"""Shots of a campaign."""
STRENGTH = 0.7
"""Multiple of the default strengths."""
FASTER = 1.3
"""Multiple of all tap velocities at which a law is tried where it was not fitted [1]."""
FASTER_SEED = 7_000_000
"""By how much later the seeds of those campaigns begin."""
BEYOND = 0.01
"""Share of the tested range by which a covariate has to leave it to count as beyond [1]."""
COMPARED = frozenset(
    {
        "free_drag_over_speed", "free_friction_over_speed", "free_friction_over_position",
        "free_force_over_position", "free_damping_over_indentation", "free_stiffness_over_indentation",
    }
)  # fmt: skip
"""Places of which the rivals have the covariates: not a gap, a time, or what a sensor shows."""
Truth = Callable[[Samples, Mapping[str, Any]], Samples]


@dataclass(frozen=True, slots=True)
class Hidden:
    """What is hidden, and what a right answer is.

    Attributes
    ----------
    place, form : str
        Empty where it is no function of one covariate: then nothing may be proposed.
    truth : callable or None
        Function of the covariate, its parameters by name.
    """

    effect: str
    place: str = ""
    form: str = ""
    truth: Truth | None = None


def _constant(name: str) -> Truth:
    return lambda u, p: np.full_like(u, p[name])


def _line(name: str, sign: float = 1.0) -> Truth:
    return lambda u, p: sign * p[name] * u


FUNCTIONS = (
    Hidden("viscous_friction", "free_drag_over_speed", "1", _constant("viscous_coefficient_n_s_per_m")),
    Hidden("quadratic_drag", "free_drag_over_speed", "u", _line("drag_coefficient_n_s2_per_m2")),
    Hidden(
        "stribeck_friction",
        "free_friction_over_speed",
        "exp(-(u/l)^2)",
        lambda u, p: p["friction_increase"] * np.exp(-((u / p["stribeck_velocity_m_s"]) ** 2)),
    ),
    Hidden("position_dependent_friction", "free_friction_over_position", "u", _line("gradient_per_m")),
    Hidden(
        "friction_patch",
        "free_friction_over_position",
        "exp(-(u-c)^2/2l^2)",
        lambda u, p: p["amplitude"] * np.exp(-0.5 * ((u - p["position_m"]) / p["width_m"]) ** 2),
    ),
    Hidden(
        "periodic_friction",
        "free_friction_over_position",
        "cos(2pi u/p) + sin(2pi u/p)",
        lambda u, p: p["amplitude"] * np.sin(2.0 * math.pi * u / p["period_m"] + p["phase_rad"]),
    ),
    Hidden("restoring_force", "free_force_over_position", "u", _line("stiffness_n_per_m", -1.0)),
    Hidden("hunt_crossley_damping", "free_damping_over_indentation", "u", _line("damping_n_s_per_m2")),
    Hidden("hertz_contact", "free_stiffness_over_indentation", "u^n"),
    Hidden("adhesion", "free_pull_over_gap", "max(1-u/l,0)"),
    Hidden("actuator_ramp", "free_speed_over_time", "max(1-u/l,0)"),
    Hidden("force_saturation", "free_reading_over_force", "max(1-c/u,0)"),
    Hidden("bilinear_contact", "free_stiffness_over_indentation", "max(1-c/u,0)"),
    Hidden(
        "magnetic_pull",
        "free_force_over_position",
        "1/(1+((u-c)/l)^2)",
        lambda u, p: p["force_n"] / (1.0 + ((u - p["position_m"]) / p["width_m"]) ** 2),
    ),
    Hidden(
        "gap_suction",
        "free_pull_over_gap",
        "1 + cos(2pi u/p)",
        lambda u, p: np.where(u < p["range_m"], p["force_n"] * np.sin(math.pi * u / p["range_m"]) ** 2, 0.0),
    ),
)
"""Functions of one covariate."""
OTHERS = tuple(
    map(
        Hidden, ("relaxing_contact", "loose_mass", "late_friction", "machine_vibration", "actuator_vibration")
    )
)
"""What no function of one of the covariates is."""
NONE = Hidden("")
"""Nothing hidden."""


def job_of(item: Hidden, turn: int, number: int) -> Job:
    """Give the campaign of one turn."""
    kind = "none" if not item.effect else "removed"
    effects = (item.effect,) if item.effect else ()
    return Job(kind, effects, FIRST_SEED + 100 * turn + number, strength=STRENGTH, shots=SHOTS)


def run(item: Hidden, job: Job, *, beside_rivals: bool = True) -> dict[str, Any]:
    """One row of the study."""
    data = campaign(job)
    library = [name for name in LIBRARY if name != item.effect]
    started = time.process_time()
    steps: dict[str, float] = {}
    found = investigate(
        data,
        seed=job.seed,
        library=library,
        progress=lambda step: steps.setdefault(step, time.process_time()) and None,
    )
    names = list(steps)
    law_step = next((i for i, step in enumerate(names) if "law" in step), None)
    row: dict[str, Any] = {
        "key": job.key,
        "effect": item.effect,
        "verdict": found.verdict,
        "added": list(found.added),
        "seconds": round(time.process_time() - started, 2),
        "law_seconds": 0.0
        if law_step is None
        else round(steps[names[law_step + 1]] - steps[names[law_step]], 2),
        "law": None,
    }
    if beside_rivals and item.place in COMPARED:
        row["rivals"] = compare(item.place, _truth(item, job), found)
    finding = found.law
    if finding is None:
        return row
    proposed = finding.proposed
    row["law"] = {
        "place": finding.term.form.place,
        "rival_places": list(finding.rival_places),
        "form": None if proposed is None else proposed.functional_form,
        "equivalents": [law.law.functional_form for law in finding.equivalents],
        "refused": finding.refused,
        "before": finding.change.before.trace,
        "after": finding.change.after.trace,
        "error": _error(item, job, finding),
        "faster": None if finding.refused else _faster(job, found, finding),
    }
    return row


def _faster(job: Job, found: DiscrepancyResult, finding: LawFinding) -> dict[str, Any]:
    """Gap with and without the law at 1.3 times the velocities, and whether that is beyond the tested range.

    The plant and what is hidden are the same, noise and scatter of friction are new; each shot has its own
    friction factor, as held-out shots have.
    """
    given = scenario(job)
    plan = CampaignScenario.model_validate(
        given.model_dump()
        | {
            "seed": job.seed + FASTER_SEED,
            "velocities_mm_per_min": [FASTER * velocity for velocity in given.velocities_mm_per_min],
        }
    )
    prepared = prepare(recorded(plan, make(plan)[1]))
    floor = sensor_noise(prepared)
    shots = shot_set(prepared, np.arange(len(prepared.shots)), floor.noise_std)
    problem = Problem(shots, len(prepared.batches))
    with_law = problem.constrained(finding.training.effects, finding.model.constraints)
    measure = GapMeasure(with_law, floor, found.replicates, job.seed)
    before, after = (
        refit_shot_parameters(problem, found.final),
        refit_shot_parameters(with_law, finding.training),
    )
    part = Part.FACTORS if finding.term.form.is_between_shots else Part.TRACES
    seen, tested = visited(with_law, after, finding.term.form), finding.term.visited
    beyond = BEYOND * (tested.upper - tested.lower)
    return {
        "before": measure.gap(before).of([part]),
        "after": measure.gap(after).of([part]),
        "beyond": seen is not None
        and (seen.upper > tested.upper + beyond or seen.lower < tested.lower - beyond),
    }


def _truth(item: Hidden, job: Job) -> Callable[[Samples], Samples] | None:
    """Give the function that is hidden in a campaign."""
    truth, values = item.truth, hidden(job)
    return None if truth is None else lambda u: truth(u, values[item.effect])


def _error(item: Hidden, job: Job, finding: LawFinding) -> float | None:
    """RMS error of the force, or factor, over the states that were visited, over its RMS.

    None without a truth.
    A constant that the plant has taken up is no error.
    """
    form, seen, function_of = finding.term.form, finding.term.visited, _truth(item, job)
    if function_of is None or finding.refused or form.place != item.place:
        return None
    truth = function_of(seen.values)
    if finding.proposed is not None:
        function = finding.proposed.values(seen.values)
    else:
        function = spline_basis(seen.values, seen.lower, seen.upper, form.spans) @ finding.term.coefficients
    difference = function - truth
    if form.constant_is:
        difference, truth = difference - difference.mean(), truth - truth.mean()
    if form.law_kind in {LawKind.BODY, LawKind.CONTACT} and seen.power is not None:
        # A drag or a damping makes the force that it takes power by, over the speed.
        speed = np.sqrt(seen.power)
        difference, truth = speed * difference, speed * truth
    return float(np.sqrt(np.mean(difference**2) / np.mean(truth**2)))


def main() -> None:
    """Add what is not there yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=10)
    parser.add_argument("--budget", type=float, default=math.inf, help="processor time [s]")
    parser.add_argument("--only", default="", help="an effect, or none")
    parser.add_argument("--from", dest="first", type=int, default=0, help="first turn")
    parser.add_argument("--alone", action="store_true", help="without the rivals")
    arguments = parser.parse_args()
    ROWS.parent.mkdir(exist_ok=True)
    known = {json.loads(line)["key"] for line in ROWS.read_text().splitlines()} if ROWS.exists() else set()
    begun = time.process_time()
    for turn in range(arguments.first, arguments.turns):
        for number, item in enumerate((*FUNCTIONS, *OTHERS, NONE)):
            if arguments.only not in {"", item.effect or "none"}:
                continue
            job = job_of(item, turn, number)
            if job.key in known or time.process_time() - begun > arguments.budget:
                continue
            with ROWS.open("a") as rows:
                row = run(item, job, beside_rivals=not arguments.alone)
                rows.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
