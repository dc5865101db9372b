"""What others do with the same shots: forward selection by BIC or likelihood ratio, PySINDy and LISDD.

The two forward selections take samples as independent and the sensors' noise as known. From the effects with
the largest first-order gain each is fitted beside what the model has, everything refitted; the best joins
until the criterion says no, or four have joined. They name no ties: whatever wins is their answer.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from impactcell.campaign import Campaign
from impactcell.discrepancy.data import noise_floor
from impactcell.discrepancy.data.prepared_campaign import prepare, shot_set, split_held_out
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.model.least_squares import Fit, fit
from impactcell.discrepancy.model.linearisation import linearise, scores
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.search import candidate_scores
from impactcell.errors import DiscrepancyError
from impactcell.physics.effects import LIBRARY
from tests.benchmarks import _discrepancy_judge as judge
from tests.benchmarks._discrepancy_lisdd import lisdd
from tests.benchmarks._discrepancy_plan import CONFOUNDED
from tests.benchmarks._discrepancy_sindy import sindy
from tests.benchmarks.table import Table
from tests.discrepancy.study import Job, campaign

MOST = 4
TRIED, FINISHED = 5, 2
FEW_STEPS, MANY_STEPS = 5, 30
FAMILY = 0.01
Row = dict[str, Any]
NAMES = {
    "ours": "impactcell",
    "bic": "BIC",
    "ratio": "likelihood ratio",
    "sindy": "PySINDy",
    "lisdd": "LISDD",
}


@dataclass(frozen=True)
class Task:
    """A campaign of the study, with the strengths it was made with."""

    job: Job
    multiples: tuple[float, ...]

    @property
    def key(self) -> str:
        """Key of the campaign's own row."""
        return self.job.key


def beside(file: Path) -> Path:
    """Where the rivals' rows are."""
    return file.with_name(f"{file.stem}-rivals.jsonl")


def subset(plan: list[Job], found: list[Row]) -> list[Task]:
    """Every third job of each kind, as far as it is done."""
    multiples = {row["key"]: tuple(row["multiples"]) for row in found if "multiples" in row}
    seen: dict[str, int] = {}
    made = []
    for job in plan:
        place = seen[job.kind] = seen.get(job.kind, -1) + 1
        if place % 3 == 0 and job.key in multiples:
            made.append(Task(job, multiples[job.key]))
    return made


def run(task: Task) -> Row:
    """Answers of the rivals on one campaign."""
    job = task.job
    library = tuple(effect for effect in LIBRARY if effect != job.removed)
    return {"key": job.key} | answers(campaign(job, task.multiples), job.seed, library)


def answers(given: Campaign, seed: int, library: tuple[str, ...]) -> Row:
    """Say what each rival names, those that it cannot tell apart together, and how long it took."""
    prepared = prepare(given)
    floor = noise_floor.sensor_noise(prepared)
    training, _ = split_held_out(prepared, seed)
    row: Row = {}
    started = time.process_time()
    problem = Problem(shot_set(prepared, training, floor.noise_std), len(prepared.batches))
    nominal = fit_nominal(problem)
    steps = Steps(problem, library)
    for which, criterion in (("bic", bic), ("ratio", likelihood_ratio)):
        row[which] = [[effect] for effect in forward(steps, nominal, criterion)]
    row["seconds"] = round(time.process_time() - started, 2)
    started = time.process_time()
    row["sindy"] = sindy(problem, nominal, library)
    row["sindy_seconds"] = round(time.process_time() - started, 2)
    started = time.process_time()
    row["lisdd"] = lisdd(problem, nominal, library)
    return row | {"lisdd_seconds": round(time.process_time() - started, 2)}


@dataclass
class Steps:
    """Fits of one effect more than a model has; kept, as the two criteria mostly go the same way."""

    problem: Problem
    library: tuple[str, ...]
    made: dict[tuple[str, ...], list[Fit]] = field(default_factory=dict)

    def beyond(self, model: Fit) -> list[Fit]:
        """Fit the most promising effects beside those of `model`."""
        if model.effects not in self.made:
            self.made[model.effects] = self._fits(model)
        return self.made[model.effects]

    def _fits(self, model: Fit) -> list[Fit]:
        linearisation = linearise(self.problem, model)
        found = candidate_scores.candidate_directions(self.problem, model, linearisation, self.library)
        scored = scores(linearisation, found.products)
        ranked = []
        for number, effect in enumerate(found.names):
            best = candidate_scores.best_points(found, scored, number, 1)
            if best:
                ranked.append((best[0][0], effect, best[0][1]))
        ranked.sort(key=lambda one: -one[0])
        few = [self._fit(model, effect, start) for _, effect, start in ranked[:TRIED]]
        order = sorted(filter(None, few), key=lambda one: -total(self.problem, one))
        done = [self._finished(one) for one in order[:FINISHED]]
        return [*filter(None, done), *order[FINISHED:]]

    def _fit(self, model: Fit, effect: str, start: np.ndarray) -> Fit | None:
        theta = np.concatenate([model.theta, start])
        effects = (*model.effects, effect)
        try:
            return fit(
                self.problem.with_effects(effects),
                theta,
                model.shot_parameters,
                spread=model.spread,
                most_steps=FEW_STEPS,
            )
        except DiscrepancyError:
            return None

    def _finished(self, one: Fit) -> Fit | None:
        return fit(
            self.problem.with_effects(one.effects),
            one.theta,
            one.shot_parameters,
            spread=one.spread,
            most_steps=MANY_STEPS,
        )


def total(problem: Problem, model: Fit) -> float:
    """Log-likelihood of all samples and factors."""
    return float(model.log_likelihood(problem.shots).sum())


def bic(problem: Problem, old: Fit, new: Fit) -> float:
    """Fall of Schwarz's criterion; positive where the effect joins."""
    more = len(new.coordinates) - len(old.coordinates)
    return 2.0 * (total(problem, new) - total(problem, old)) - more * math.log(problem.shots.values.size)


def likelihood_ratio(problem: Problem, old: Fit, new: Fit) -> float:
    """Ratio statistic less the quantile it has to exceed, at 1 % over the whole library (Bonferroni)."""
    more = len(new.coordinates) - len(old.coordinates)
    ratio = 2.0 * (total(problem, new) - total(problem, old))
    return ratio - float(chi2.isf(FAMILY / len(LIBRARY), more))


def forward(steps: Steps, nominal: Fit, gain: Callable[[Problem, Fit, Fit], float]) -> tuple[str, ...]:
    """Effects that join while the criterion says so."""
    model = nominal
    while len(model.effects) < MOST:
        fits = steps.beyond(model)
        best = max(fits, key=lambda new: gain(steps.problem, model, new), default=None)
        if best is None or gain(steps.problem, model, best) <= 0.0:
            break
        model = best
    return model.effects


def answered(row: Row, groups: list[list[str]]) -> Row:
    """Row of an answer as `judged` reads it, whose groups cannot be told apart by the method itself."""
    return {
        "job": row["job"],
        "verdict": "named" if groups else "no_gap",
        "named": [one[0] for one in groups],
        "tied": {one[0]: one[1:] for one in groups},
    }


def generous(row: Row) -> Row:
    """Same row with exact confounds tied: no method can tell them, and these know of no ties."""
    named = list(row["named"])
    tied = {
        one: sorted({*row["tied"].get(one, []), *(CONFOUNDED - {one} if one in CONFOUNDED else ())})
        for one in named
    }
    return row | {"tied": tied}


def table(found: list[Row], rivals: list[Row]) -> Table | None:
    """Bars of ours beside the rivals', on the campaigns that all were given."""
    if not rivals:
        return None
    ours = {row["key"]: row for row in found}
    rivals = [row for row in rivals if row["key"] in ours and "sindy" in row]
    names = {
        which: name for which, name in NAMES.items() if which == "ours" or any(which in r for r in rivals)
    }
    answers = {
        which: [
            (ours[row["key"]], ours[row["key"]] if which == "ours" else generous(answered(row, row[which])))
            for row in rivals
            if which == "ours" or which in row  # earlier rows are without those that came later
        ]
        for which in names
    }
    right = {judge.RIGHT, judge.TIED}
    falsely = {judge.WRONG, judge.PARTIAL, judge.FALSE}
    wanted: list[tuple[str, set[str], set[str]]] = [
        ("one effect, gap >= 2: named, or tied with it", {"visible"}, right),
        ("one effect, gap >= 2: anything else", {"visible"}, falsely),
        ("one effect, gap 1.2 to 1.5: named, or tied with it", {"subtle"}, right),
        ("one effect, gap 1.2 to 1.5: anything else", {"subtle"}, falsely),
        ("nothing hidden: something named", {"none"}, right | falsely),
        ("two hidden: both right", {"two"}, right),
        ("outside the vocabulary: something named", {"outside"}, right | falsely),
        ("removed from the library: a wrong name", {"removed"}, {judge.WRONG, judge.FALSE, judge.PARTIAL}),
    ]
    lines = []
    for what, kinds, accepted in wanted:
        cells = [what]
        for which in names:
            mine = [answer for campaign, answer in answers[which] if category(campaign) in kinds]
            count = sum(judge.judged(answer) in accepted for answer in mine)
            cells.append(" · ".join(part for part in judge.share(count, len(mine))))
        lines.append(cells)
    seconds = {
        "ours": [ours[row["key"]].get("seconds", math.nan) for row in rivals],
        "bic": [row["seconds"] for row in rivals],
        "sindy": [row["sindy_seconds"] for row in rivals],
        "lisdd": [row["lisdd_seconds"] for row in rivals if "lisdd_seconds" in row],
    }
    times = [f"{np.nanmedian(seconds[which]):.1f} s" if which in seconds else "(with BIC)" for which in names]
    lines.append(["processor time (median)", *times])
    note = f"The same {len(rivals)} campaigns: every third of each kind. An exact confound counts as right."
    return Table("Discrepancy: beside rivals", ("what", *names.values()), lines, note)


def category(row: Row) -> str:
    """Kind of a campaign; one effect alone goes by the measured gap."""
    kind = str(row["job"]["kind"])
    if kind not in {"single", "subtle"}:
        return kind
    gap = row.get("gap", {}).get("held_out", {}).get("before") or 0.0
    return "visible" if gap >= 2.0 else "subtle" if 1.2 <= gap <= 1.5 else "neither"
