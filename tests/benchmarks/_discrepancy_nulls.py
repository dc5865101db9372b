"""Discrepancy with nothing hidden, in five classes of noise: how often something is established all the same.

`python -m tests.benchmarks._discrepancy_nulls [--campaigns 500]` makes them on the simulator's own plant, the
classes in turn, and investigates them as `impactcell discrepancy` does, the search for a law included. A row
a campaign goes to `--rows`, and the next run goes on from there; `--table` only prints. In every other
campaign of a class the noise is not stated. Seeds of the report are from 880 000 on, those for setting
numbers of the search (`--tuning`) from 790 000 on. Classes:

- `white`: normal, independent from sample to sample;
- `correlated`: of first order, over 2 ms;
- `heavy tailed`: Student's t with three degrees of freedom;
- `quantised`: white, and read in steps of two of its standard deviations, stated together;
- `real residuals`: of the force, what Coulomb friction and a constant slope leave of the measured strokes of
  pistons; of the position, what a smooth curve leaves of a pendulum's encoder (`shared/data/real`, which
  must be there).
"""

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat
from scipy.signal import lfilter, savgol_filter

from impactcell.campaign import Campaign
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.workflow import investigate
from impactcell.records import Capture, Channel, Samples
from simulator.campaign import make
from simulator.campaign_scenario import CampaignScenario
from tests.benchmarks import _discrepancy_judge as judge
from tests.benchmarks._discrepancy_run import from_command_line
from tests.benchmarks.table import Table
from tests.conftest import SHARED
from tests.discrepancy.study import RATE_HZ, Job, recorded, scenario

ROWS = Path("tests/benchmarks/rows/discrepancy-nulls-880000.jsonl")
TUNING_ROWS = Path("bench-results/discrepancy-nulls-tuning.jsonl")
REPORTING, TUNING = 880_000, 790_000
"""First seeds."""
SHOTS = (30, 60, 100)
"""Of a campaign, in turn."""
CORRELATION_S, TAILS, STEPS = 2e-3, 3.0, 2.0
"""Of the classes: correlation time, degrees of freedom, step in standard deviations."""
STROKE = (0.2, 0.9)
"""Share of a piston's stroke that is used: before, its seal gives; after, it slows down."""
LEAST_SPEED_MM_S, LEAST_SAMPLES = 2.0, 100
"""Of a stroke."""
WINDOW = 51
"""Samples of the smooth curve, a cubic, through a pendulum's angle."""
Random = np.random.Generator


@dataclass(frozen=True)
class NullJob:
    """One campaign with nothing hidden."""

    noise: str
    seed: int
    shots: int
    stated: bool

    @property
    def key(self) -> str:
        """The same for the same campaign."""
        return json.dumps(asdict(self), sort_keys=True)


def jobs(campaigns: int, first: int) -> list[NullJob]:
    """The classes in turn."""
    names = list(NOISES)
    return [
        NullJob(
            names[n % len(names)], first + n, SHOTS[n // len(names) % len(SHOTS)], n // len(names) % 2 == 0
        )
        for n in range(campaigns)
    ]


def _white(rng: Random, channel: str, count: int) -> Samples:
    return rng.standard_normal(count)


def _correlated(rng: Random, channel: str, count: int) -> Samples:
    keep = math.exp(-1.0 / (RATE_HZ * CORRELATION_S))
    kicks = rng.standard_normal(count)
    kicks[1:] *= math.sqrt(1.0 - keep**2)
    noise: Samples = lfilter([1.0], [1.0, -keep], kicks)
    return noise


def _heavy_tailed(rng: Random, channel: str, count: int) -> Samples:
    return rng.standard_t(TAILS, count) / math.sqrt(TAILS / (TAILS - 2.0))


def _real(rng: Random, channel: str, count: int) -> Samples:
    """Take a stretch of a real residual; one that is too short goes on backwards, and forwards again."""
    stretches = _strokes() if channel == "force" else _angles()
    stretch = stretches[rng.integers(len(stretches))]
    stretch = stretch / stretch.std()
    whole = np.concatenate([stretch, stretch[::-1]])
    begin = int(rng.integers(len(whole)))
    return np.resize(np.roll(whole, -begin), count) * rng.choice([-1.0, 1.0])


NOISES: Mapping[str, Callable[[Random, str, int], Samples]] = {
    "white": _white,
    "correlated": _correlated,
    "heavy tailed": _heavy_tailed,
    "quantised": _white,
    "real residuals": _real,
}


@lru_cache(maxsize=1)
def _strokes() -> list[Samples]:
    """Force [N] of each stroke of each piston, less a constant and a slope over its place."""
    made = []
    for file in sorted((SHARED / "real" / "pneumatic-seal").glob("*.csv")):
        columns = np.loadtxt(file, delimiter="\t")
        time_s, place, force = 1e-3 * columns[:, 0], columns[:, 4], columns[:, 6]
        speed = savgol_filter(place, WINDOW, 2, deriv=1, delta=float(np.median(np.diff(time_s))))
        moving = np.sign(speed) * (np.abs(speed) > LEAST_SPEED_MM_S)
        edges = [0, *(np.flatnonzero(np.diff(moving)) + 1), len(moving)]
        for begin, end in pairwise(edges):
            used = slice(*(begin + int(share * (end - begin)) for share in STROKE))
            if moving[begin] and used.stop - used.start >= LEAST_SAMPLES:
                line = np.polynomial.Polynomial.fit(place[used], force[used], 1)
                made.append(force[used] - line(place[used]))
    return made


@lru_cache(maxsize=1)
def _angles() -> list[Samples]:
    """Angle [rad] of each piece of the pendulum's record, less a smooth curve."""
    file = SHARED / "real" / "free-pendulum" / "SinglePendulumDataForParameterEstimation.mat"
    content = loadmat(file)
    pieces = [piece[0] for name in ("Y_id", "Y_vad") for piece in content[name].ravel()]
    return [piece - savgol_filter(piece, WINDOW, 3) for piece in pieces]


def null_campaign(job: NullJob) -> Campaign:
    """Make a campaign of an idle plant's own, with the noise of the job's class on every channel."""
    plan = scenario(Job("none", (), job.seed, shots=job.shots))
    sensors = {name: dict(one) for name, one in plan.sensors.model_dump().items() if one}
    stds = {name: one["noise_std"] for name, one in sensors.items()}
    quiet = {"sensors": {name: one | {"noise_std": 0.0} for name, one in sensors.items()}}
    plan = CampaignScenario.model_validate(plan.model_dump() | quiet)
    campaign = recorded(plan, make(plan)[1])
    rng = np.random.default_rng([job.seed, 13])
    shots = tuple(_noisy(shot, job, stds, rng) for shot in campaign.shots)
    told = {
        name: replace(sensor, noise_std=stds[name] if job.stated else None)
        for name, sensor in campaign.sensors.items()
    }
    return replace(campaign, shots=shots, sensors=told)


def _noisy(shot: Capture, job: NullJob, stds: Mapping[str, float], rng: Random) -> Capture:
    changed: dict[str, Any] = {}
    for name, std in stds.items():
        channel: Channel = getattr(shot, name)
        step = STEPS * std / math.sqrt(1.0 + STEPS**2 / 12.0) if job.noise == "quantised" else 0.0
        values = channel.values + (step / STEPS or std) * NOISES[job.noise](rng, name, channel.values.size)
        if step:
            values = step * np.round(values / step)
        changed[name] = replace(channel, values=values, noise_std=std if job.stated else None)
    return replace(shot, **changed)


def run(job: NullJob) -> dict[str, Any]:
    """One row of the study."""
    given = null_campaign(job)
    started = time.process_time()
    outcome = result_document(investigate(given, seed=job.seed))
    return {
        "key": job.key,
        "verdict": outcome["verdict"],
        "headline": outcome["headline"],
        "named": [one["effect"] for one in outcome["effects"]],
        "law": None if outcome["law"] is None else outcome["law"]["form"],
        "gap": outcome["gap"],
        "seconds": round(time.process_time() - started, 2),
    }


def table(found: list[dict[str, Any]]) -> Table:
    """What is established where there is nothing, class by class."""
    lines = []
    for noise in (*NOISES, ""):
        among = [row for row in found if noise in ("", row["job"]["noise"])]

        def bar(what: str, limit: str, count: int, among: list[dict[str, Any]] = among) -> list[str]:
            return [what, limit, *judge.share(count, len(among))]

        words = f"{noise}: " if noise else "all: "
        lines.append(bar(f"{words}something established", "<= 5 %", sum(bool(r.get("named")) for r in among)))
        lines.append(bar(f"{words}a law proposed", "<= 1 %", sum(bool(r.get("law")) for r in among)))
        unknown = sum(row["verdict"] in ("unknown", judge.ERROR) for row in among)
        lines.append(bar(f"{words}unknown or failed", "-", unknown))
    seconds = np.median([row["seconds"] for row in found if "seconds" in row])
    note = (
        f"{len(found)} campaigns of 30, 60 and 100 shots, half of them without the noise stated; median "
        f"{seconds:.1f} s of processor time. Real residuals: strokes of pistons, a pendulum's encoder."
    )
    return Table(
        "Discrepancy: nothing hidden, by class of noise",
        ("what", "bar", "measured", "95 % interval"),
        lines,
        note,
    )


def main() -> None:
    """Run what the arguments say, then print the table."""
    _, found = from_command_line(jobs, run, 500, (REPORTING, ROWS), (TUNING, TUNING_ROWS))
    print(table(found).markdown())


if __name__ == "__main__":
    main()
