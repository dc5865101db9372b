"""Discrepancy workflow: hidden effects against answers, over campaigns made by the simulator's own plant.

`python -m tests.benchmarks.discrepancy [--rows FILE] [--per 4] [--kinds single,none]` runs the study: a row a
campaign, appended as it is done; what is there already is not done again. `tables` reads the rows.
"""

import argparse
import json
import math
import os
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
from tests.benchmarks.table import Table

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


def judged(row: dict[str, Any]) -> str:
    """right, tied, unknown, no_gap or wrong."""
    if row["verdict"] in {"error", "no_gap"}:
        return row["verdict"]
    hidden, named = set(row["hidden"]), list(row["named"])
    if row["verdict"] == "unknown":
        return "unknown" if set(named) <= hidden else "wrong"
    groups = [{effect, *row["tied"].get(effect, [])} for effect in named]
    right = len(groups) == len(hidden) and all(any(one in group for group in groups) for one in hidden)
    if not right:
        missed = all(any(one in hidden for one in group) for group in groups)
        return "partial" if missed and groups else "wrong"
    return "tied" if row["verdict"] == "tied" else "right"


def interval(count: int, total: int) -> str:
    """Wilson interval of a share at 95 %."""
    if not total:
        return "-"
    z, share = 1.96, count / total
    middle = (share + z * z / (2 * total)) / (1 + z * z / total)
    half = z * math.sqrt(share * (1 - share) / total + z * z / (4 * total * total)) / (1 + z * z / total)
    return f"{100 * max(middle - half, 0):.1f}-{100 * min(middle + half, 1):.1f} %"


def share(rows_of: list[dict[str, Any]], accepted: set[str]) -> tuple[str, str]:
    """Share of rows whose judgement is among `accepted`, with its interval."""
    count = sum(judged(row) in accepted for row in rows_of)
    total = len(rows_of)
    measured = f"{count}/{total}" + (f" = {100 * count / total:.1f} %" if total else "")
    return measured, interval(count, total)


def tables(file: Path = ROWS) -> list[Table]:
    """Bars and confusion matrix from the rows there are."""
    found = rows(file)
    gap = [row.get("gap", {}).get("held_out", {}).get("before") or 0.0 for row in found]
    single = [row for row in found if row["kind"] in {"single", "subtle"}]
    size = {row["key"]: value for row, value in zip(found, gap, strict=True)}
    visible = [row for row in single if size[row["key"]] >= 2.0]
    subtle = [row for row in single if 1.2 <= size[row["key"]] <= 1.5]
    confounded = [row for row in single if row["hidden"][0] in {"mass_error", "force_sensor_gain"}]
    none = [row for row in found if row["kind"] == "none"]
    two = [row for row in found if row["kind"] == "two"]
    outside = [row for row in found if row["kind"] == "outside"]
    removed = [row for row in found if row["kind"] == "removed"]
    right = {"right", "tied"}
    bars: list[list[str]] = []

    def bar(what: str, limit: str, rows_of: list[dict[str, Any]], accepted: set[str]) -> None:
        bars.append([what, limit, *share(rows_of, accepted)])

    bar("visible (gap >= 2): named, or tied with it", ">= 95 %", visible, right)
    bar("visible: anything else named", "<= 5 %", visible, {"wrong", "partial"})
    bar("subtle (gap 1.2 to 1.5): named, or tied with it", ">= 80 %", subtle, right)
    bar("subtle: anything else named", "<= 5 %", subtle, {"wrong", "partial"})
    bar("exact confound: tied", "always", [row for row in confounded if row["verdict"] != "no_gap"], {"tied"})
    bar("nothing hidden: something named", "<= 5 %", none, {"wrong", "partial", "right", "tied"})
    bar("two hidden: both right", ">= 85 %", two, right)
    bar("outside the vocabulary: unknown, nothing listed", ">= 80 %", outside, {"unknown"})
    bar("effect removed from the library: wrong name", "<= 5 %", removed, {"wrong", "partial"})
    closed = [row for row in visible if judged(row) in right]
    after = [row["gap"]["held_out"]["after"] for row in closed]
    if after:
        bars.append(
            ["held-out gap after the right effect (median; 95th percentile)", "<= 1.1",
             f"{np.median(after):.3f}; {np.quantile(after, 0.95):.3f}", f"{len(after)} campaigns"]
        )  # fmt: skip
    covered = [one for row in found if judged(row) in right for one in row.get("covered", [])]
    if covered:
        count = sum(covered)
        bars.append(
            ["parameters inside their 95 % intervals", "90-98 %",
             f"{count}/{len(covered)} = {100 * count / len(covered):.1f} %", interval(count, len(covered))]
        )  # fmt: skip
    note = f"{len(found)} campaigns of 30 to 100 shots, made by the simulator's own plant."
    return [
        Table("Discrepancy: bars", ("what", "bar", "measured", "95 % interval"), bars, note),
        confusion(found),
    ]


def confusion(found: list[dict[str, Any]]) -> Table:
    """Effect against answer: named, tied, unknown, nothing, or something else (and what)."""
    lines: list[list[str]] = []
    kinds: dict[str, list[dict[str, Any]]] = {}
    for row in found:
        group = {"single": "", "subtle": "", "none": "nothing", "two": "two effects"}.get(
            row["kind"], row["kind"]
        )
        name = row["hidden"][0] if not group else group if row["kind"] in {"none", "two"} else ""
        name = name or (
            f"{row['hidden'][0]}, {'not in any library' if row['kind'] == 'outside' else 'removed'}"
        )
        kinds.setdefault(name, []).append(row)
    for name in sorted(kinds):
        answers = [judged(row) for row in kinds[name]]
        others = sorted(
            {"+".join(row["named"]) for row in kinds[name] if judged(row) in {"wrong", "partial"}}
        )
        lines.append(
            [name, *(str(answers.count(one)) for one in ("right", "tied", "unknown", "no_gap", "partial", "wrong")),
             ", ".join(others)]
        )  # fmt: skip
    columns = ("hidden", "named", "tied with it", "unknown", "no gap", "one of two", "wrong", "named instead")
    return Table("Discrepancy: hidden effect against answer", columns, lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--per", type=int, default=2)
    parser.add_argument("--kinds", default="")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--table", action="store_true", help="only print the tables of the rows there are")
    given = parser.parse_args()
    if not given.table:
        study(given.rows, given.per, set(filter(None, given.kinds.split(","))), given.workers)
    for made in tables(given.rows):
        print(made.markdown())
