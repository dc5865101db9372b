"""How long the discrepancy workflow takes on 60 shots of two channels of 1600 samples, by what is hidden.

`python -m tests.benchmarks._discrepancy_speed [--campaigns 4] [--kinds two removed]`: force and position at
the rate that gives 1600 samples on the mean; one effect, two, one that the library lacks, nothing. The search
for a law, which only begins where something remains, is told by itself.
"""

import argparse
import itertools
import time
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Campaign
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.workflow import investigate
from impactcell.physics.effects import LIBRARY
from tests.benchmarks._discrepancy_judge import EQUAL, NO_GAP, RIGHT, TIED, UNKNOWN, judged
from tests.benchmarks._discrepancy_plan import calibrated, jobs
from tests.benchmarks.table import Table
from tests.discrepancy import study

SAMPLES = 1600
"""Samples of a channel and shot, on the mean."""
SHOTS = 60
"""Shots of a campaign."""
BAR_S, LAW_BAR_S = 10.0, 30.0
"""Processor time of the workflow, median, and of the search for a law beside it [s]."""
NEED_ACTUATOR = frozenset({"actuator_droop", "actuator_ramp"})
"""Effects that two channels cannot show."""
KINDS = {
    "single": "one effect",
    "two": "two effects",
    "removed": "an effect that the library lacks",
    "none": "nothing",
}
"""Kinds of the study's plan, and what is hidden in them."""
ANSWERS = {"single": {RIGHT, TIED}, "two": {RIGHT, TIED}, "removed": {UNKNOWN, EQUAL}, "none": {NO_GAP}}
"""Answers that are right."""
LAW_STEP = "looking for a law that nobody has listed"
"""What the workflow calls that step."""


@dataclass(frozen=True)
class Timed:
    """What one campaign took.

    Attributes
    ----------
    workflow_s, law_s : float
        Processor time, that of the search for a law apart [s].
    samples : float
        Of a channel and shot, on the mean.
    right : bool
        Named, tied, said to be unknown or to be nothing, whichever is right.
    """

    workflow_s: float
    law_s: float
    samples: float
    right: bool


def timed(job: study.Job) -> Timed:
    """Run the workflow on a campaign of the plan."""
    multiples, _ = calibrated(job)
    given = _with_samples(job, multiples)
    steps: list[tuple[str, float]] = []
    started = time.process_time()
    result = investigate(
        given,
        seed=job.seed,
        library=[effect for effect in LIBRARY if effect != job.removed],
        progress=lambda step: steps.append((step, time.process_time())),
    )
    steps.append(("end", time.process_time()))
    pairs = itertools.pairwise(steps)
    law_s = sum(after - before for (step, before), (_, after) in pairs if step == LAW_STEP)
    outcome = result_document(result)
    row = {
        "job": {"hidden": job.hidden, "removed": job.removed},
        "verdict": outcome["verdict"],
        "named": list(result.added),
        "tied": {effect["effect"]: effect["tied_with"] for effect in outcome["effects"]},
    }
    return Timed(
        steps[-1][1] - started - law_s, law_s, _mean_samples(given), judged(row) in ANSWERS[job.kind]
    )


def _mean_samples(given: Campaign) -> float:
    return float(np.mean([len(shot.position.values) for shot in given.shots if shot.position]))


def _with_samples(job: study.Job, multiples: tuple[float, ...]) -> Campaign:
    before, given = study.RATE_HZ, study.campaign(job, multiples)
    study.RATE_HZ = before * SAMPLES / _mean_samples(given)
    try:
        return study.campaign(job, multiples)
    finally:
        study.RATE_HZ = before


def _of_kind(kind: str, campaigns: int) -> list[study.Job]:
    """First campaigns of a kind in the study's plan that two channels can show."""
    able = [job for job in jobs() if job.kind == kind and not NEED_ACTUATOR & set(job.hidden)]
    return [replace(job, actuator=False, shots=SHOTS) for job in able[:campaigns]]


def table(campaigns: int, kinds: tuple[str, ...] = tuple(KINDS)) -> Table:
    """Times over the first campaigns of each kind."""
    timed(_of_kind("two", 1)[0])  # compiles
    rows, samples = [], []
    for kind in kinds:
        runs = [timed(job) for job in _of_kind(kind, campaigns)]
        samples += [run.samples for run in runs]
        right = f"{sum(run.right for run in runs)} of {len(runs)}"
        rows.append([KINDS[kind], _bar(BAR_S), *_spread([run.workflow_s for run in runs]), right])
        laws = [run.law_s for run in runs if run.law_s > 0.0]
        if laws:
            rows.append(
                ["the law search beside it", _bar(LAW_BAR_S), *_spread(laws), f"{len(laws)} searches"]
            )
    note = f"{np.mean(samples):.0f} samples a channel on the mean; machine code from an earlier run."
    title = f"Discrepancy: processor time, {SHOTS} shots, force and position"
    return Table(title, ("hidden", "bar, median", "median", "least to most", "right"), rows, note)


def _bar(limit_s: float) -> str:
    return f"{limit_s:.0f} s"


def _spread(values: list[float]) -> tuple[str, str]:
    return f"{np.median(values):.1f} s", f"{min(values):.1f}-{max(values):.1f} s"


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--campaigns", type=int, default=4)
    parser.add_argument("--kinds", nargs="+", choices=tuple(KINDS), default=tuple(KINDS))
    arguments = parser.parse_args()
    print(table(arguments.campaigns, tuple(arguments.kinds)).markdown())
