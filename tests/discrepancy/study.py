"""Study of the discrepancy workflow: campaigns with hidden effects, a row of a file for each, resumable."""

import json
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.campaign import Campaign, Excitation, Sensor
from impactcell.discrepancy.result import result
from impactcell.discrepancy.workflow import investigate
from impactcell.errors import ImpactCellError
from impactcell.physics.effects import LIBRARY
from impactcell.records import Capture, Channel
from simulator.campaign import make
from simulator.campaign_scenario import CampaignScenario
from simulator.effects import LIBRARY as LAWS
from simulator.effects import UNLISTED

ROWS = Path("bench-results/discrepancy.jsonl")
MM_PER_MIN = 1e-3 / 60.0
RATE_HZ = 5000.0
BETWEEN = ("batch_shift", "direction_asymmetry", "friction_drift")


@dataclass(frozen=True)
class Job:
    """One campaign: what is hidden, how strongly, and what the campaign is like."""

    kind: str
    hidden: tuple[str, ...]
    seed: int
    strength: float = 1.0
    shots: int = 60
    coloured: bool = False
    replicates: bool = True
    actuator: bool = True
    removed: str = ""

    @property
    def key(self) -> str:
        return json.dumps(asdict(self), sort_keys=True)


def jobs(per: int) -> Iterator[Job]:
    """The plan, `per` campaigns of everything, the seeds differing."""
    effects = sorted(LAWS)
    for turn in range(per):
        for place, effect in enumerate(effects):
            seed = 10_000 * (turn + 1) + place
            strength = float(np.random.default_rng(seed).uniform(0.8, 1.7))
            actuator = effect in {"actuator_droop", "actuator_ramp"} or seed % 3 > 0
            yield Job("single", (effect,), seed, round(strength, 3), actuator=actuator)
        for place, effect in enumerate(sorted(UNLISTED)):
            yield Job("outside", (effect,), 10_000 * (turn + 1) + 100 + place, 1.0)
        for place in range(8):
            seed = 10_000 * (turn + 1) + 200 + place
            yield Job(
                "none",
                (),
                seed,
                shots=(30, 60, 100)[place % 3],
                coloured=place % 2 == 1,
                replicates=place % 4 < 2,
            )
        for place in range(8):
            seed = 10_000 * (turn + 1) + 300 + place
            rng = np.random.default_rng(seed)
            first, second = rng.choice(effects, 2, replace=False)
            yield Job("two", (str(first), str(second)), seed, round(float(rng.uniform(0.8, 1.5)), 3))
        for place, effect in enumerate(effects):
            seed = 10_000 * (turn + 1) + 400 + place
            yield Job(
                "subtle", (effect,), seed, round(float(np.random.default_rng(seed).uniform(0.2, 0.5)), 3)
            )
        for place, effect in enumerate(effects):
            if turn % 2 == 0:
                yield Job("removed", (effect,), 10_000 * (turn + 1) + 500 + place, 1.2, removed=effect)


def strengths(effect: str, strength: float) -> dict[str, float | list[float]]:
    """Parameters of an effect at a multiple of its default strength."""
    defaults = {**LAWS, **UNLISTED}[effect].defaults
    first, *rest = defaults.items()
    name, value = first
    if effect == "hertz_contact":
        return {name: 1.0 + (float(value) - 1.0) * strength}
    if effect in {"presliding_compliance", "force_saturation"}:
        return {
            name: float(value) * (1.3 - 0.3 * strength if effect == "force_saturation" else 1.0 / strength)
        }
    if isinstance(value, float | int):
        scaled: float | list[float] = float(value) * strength
    else:
        scaled = [float(one) * strength for one in value]
    return {name: scaled, **{k: v if isinstance(v, float) else list(v) for k, v in rest}}


def scenario(job: Job) -> CampaignScenario:
    """The simulator's scenario of a job."""
    rng = np.random.default_rng([job.seed, 5])
    noise = {"force": 0.4, "position": 1.5e-6, "actuator": 1.5e-6}
    sensors = {
        name: {"rate_hz": RATE_HZ, "noise_std": std}
        for name, std in noise.items()
        if name != "actuator" or job.actuator
    }
    return CampaignScenario.model_validate(
        {
            "format": 1,
            "seed": job.seed,
            "plant": {
                "stiffness_n_per_m": float(rng.uniform(5e5, 9e5)),
                "damping_n_s_per_m": float(rng.uniform(300, 600)),
                "mu_s": float(rng.uniform(0.15, 0.25)),
                "ratio": float(rng.choice([0.7, 0.76, 0.82])),
            },
            "velocity_jitter": 0.0 if job.replicates else 0.1,
            "shots": job.shots,
            "batches": ["A", "B"],
            "dwell_s": [1.0, 1000.0],
            "friction_scatter": float(rng.choice([0.008, 0.012, 0.016])),
            "sensors": sensors,
            "noise": {"colour": "coloured" if job.coloured else "white"},
            "hide": list(job.hidden),
            "strengths": {effect: strengths(effect, job.strength) for effect in job.hidden},
        }
    )


def campaign(job: Job) -> Campaign:
    """Make the campaign of a job, without going through files."""
    plan = scenario(job)
    _, made = make(plan)
    shots = []
    for shot in made:
        channels = {
            name: Channel(time, values, getattr(plan.sensors, name).noise_std)
            for name, (time, values) in shot.channels.items()
        }
        shots.append(
            Capture(
                cycle=shot.plan.number,
                velocity_m_s=shot.plan.velocity * MM_PER_MIN,
                mass_kg=shot.plan.mass_kg,
                force=channels.get("force"),
                position=channels.get("position"),
                actuator=channels.get("actuator"),
                direction=shot.plan.direction,
                stroke_m=plan.stroke_m,
                batch_id=plan.batches[shot.plan.batch],
                dwell_s=shot.plan.dwell_s,
                start_m=shot.plan.start_m,
            )
        )
    return Campaign(
        Excitation.TAP,
        tuple(shots),
        stroke_m=plan.stroke_m,
        sensors={name: Sensor(RATE_HZ, channel.noise_std) for name, channel in channels.items()},
        columns=("shot", "velocity_mm_per_min", "mass_kg", "direction", "batch", "dwell_s"),
    )


def run(job: Job) -> dict[str, Any]:
    """One row of the study."""
    started = time.process_time()
    row: dict[str, Any] = {"key": job.key, **asdict(job), "hidden": list(job.hidden)}
    library = [effect for effect in LIBRARY if effect != job.removed]
    try:
        found = investigate(campaign(job), seed=job.seed, library=library)
    except (ImpactCellError, ValueError, np.linalg.LinAlgError) as error:
        return row | {"verdict": "error", "error": str(error)}
    outcome = result(found)
    row |= {
        "verdict": outcome["verdict"],
        "named": [one["effect"] for one in outcome["effects"]],
        "tied": {one["effect"]: one["tied_with"] for one in outcome["effects"]},
        "p": [one["p_value"] for one in outcome["effects"]],
        "where": [one["where"]["phase"] for one in outcome["effects"]],
        "unexplained": outcome["unexplained"],
        "gap": outcome["gap"],
        "p_nominal": found.search.nominal.p_value,
        "p_final": found.search.final.p_value,
        "covered": _covered(job, outcome),
        "tried": [
            [*one.effects, round(one.behind, 1), round(one.behind_std, 1)]
            for one in found.search.alternatives[:6]
        ],
        "seconds": round(time.process_time() - started, 2),
    }
    return row


def _covered(job: Job, outcome: dict[str, Any]) -> list[bool]:
    """For each scalar parameter of a rightly named effect, whether its interval holds the truth."""
    made = []
    for one in outcome["effects"]:
        if one["effect"] not in job.hidden:
            continue
        for name, truth in strengths(one["effect"], job.strength).items():
            got = one["parameters"].get(name)
            if got is None:
                continue
            several = truth if isinstance(truth, list) else [truth]
            ends = got["ci95"] if isinstance(got["value"], list) else [got["ci95"]]
            for value, (low, high) in zip(several, ends, strict=False):
                if low is not None and high is not None:
                    made.append(bool(low <= value <= high))
    return made


def study(file: Path, per: int, kinds: set[str], workers: int) -> None:
    """Run what is missing; a row is appended and flushed as soon as it is done."""
    file.parent.mkdir(parents=True, exist_ok=True)
    done = {row["key"] for row in rows(file)}
    todo = [job for job in jobs(per) if job.key not in done and (not kinds or job.kind in kinds)]
    # In an order that leaves every kind with its share whenever the study is interrupted.
    todo = [todo[i] for i in np.random.default_rng(1).permutation(len(todo))]
    print(f"{len(done)} done, {len(todo)} to do", file=sys.stderr, flush=True)
    with file.open("a", encoding="utf-8") as out, ProcessPoolExecutor(workers) as pool:
        for future in as_completed([pool.submit(run, job) for job in todo]):
            out.write(json.dumps(future.result(), allow_nan=True) + "\n")
            out.flush()


def rows(file: Path = ROWS) -> list[dict[str, Any]]:
    """Rows of earlier runs."""
    if not file.exists():
        return []
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines() if line.strip()]
