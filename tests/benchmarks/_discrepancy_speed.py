"""How long the discrepancy workflow takes on 60 shots of two channels of 1600 samples, two effects hidden.

`python -m tests.benchmarks._discrepancy_speed [--campaigns 12]`: force and position at the rate that gives
1600 samples on the mean, all effects of the library as candidates, threads on all cores as the command has.
"""

import argparse
import os
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from impactcell.campaign import Campaign
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.workflow import investigate
from tests.benchmarks._discrepancy_judge import RIGHT, TIED, judged
from tests.benchmarks._discrepancy_plan import calibrated, jobs
from tests.benchmarks.table import Table
from tests.discrepancy import study

SAMPLES = 1600
BAR_S = 60.0


def timed(job: study.Job) -> tuple[float, float, float, bool]:
    """Wall clock and processor time [s], samples a channel, and whether the right effects are named."""
    multiples, _ = calibrated(job)
    given = _with_samples(job, multiples)
    samples = np.mean([len(shot.position.values) for shot in given.shots if shot.position])
    wall, cpu = time.perf_counter(), time.process_time()
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        found = investigate(
            given, seed=job.seed, mapper=lambda function, items: list(pool.map(function, items))
        )
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    outcome = result_document(found)
    row = {
        "job": {"hidden": job.hidden, "removed": job.removed},
        "verdict": outcome["verdict"],
        "named": list(found.added),
        "tied": {one["effect"]: one["tied_with"] for one in outcome["effects"]},
    }
    return wall, cpu, float(samples), judged(row) in {RIGHT, TIED}


def _with_samples(job: study.Job, multiples: tuple[float, ...]) -> Campaign:
    before, given = study.RATE_HZ, study.campaign(job, multiples)
    samples = np.mean([len(shot.position.values) for shot in given.shots if shot.position])
    study.RATE_HZ = before * SAMPLES / float(samples)
    try:
        return study.campaign(job, multiples)
    finally:
        study.RATE_HZ = before


def table(campaigns: int) -> Table:
    """Times over the first pairs of the study's plan that two channels can show."""
    actuator = {"actuator_droop", "actuator_ramp"}
    pairs = [job for job in jobs() if job.kind == "two" and not actuator & set(job.hidden)]
    timed(replace(pairs[-1], actuator=False))  # compiles
    found = [timed(replace(job, actuator=False)) for job in pairs[:campaigns]]
    lines = []
    for place, what, limit in ((0, "time", f"{BAR_S:.0f} s"), (1, "processor time", "")):
        values = [one[place] for one in found]
        lines.append([what, limit, f"{np.median(values):.1f} s", f"{min(values):.1f}-{max(values):.1f} s"])
    right = sum(one[3] for one in found)
    note = (
        f"{os.cpu_count()} cores; {np.mean([one[2] for one in found]):.0f} samples a channel on the mean; "
        f"{right} of {len(found)} rightly named or tied."
    )
    title = "Discrepancy: 60 shots, force and position, two effects hidden"
    return Table(title, ("what", "bar", "median", "least to most"), lines, note)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--campaigns", type=int, default=12)
    print(table(parser.parse_args().campaigns).markdown())
