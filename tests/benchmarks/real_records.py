"""Discrepancy workflow on records of real machines, through its command line, as they are and disturbed.

`python -m tests.benchmarks.real_records DATA [--set NAME] [--way NAME] [--rows FILE]` converts what others
have measured (folders `free-pendulum`, `servo-pendulum` and `pneumatic-seal` of DATA) to campaigns, runs
`impactcell discrepancy --base` on them and appends a row to `--rows`; what is there already is not done
again. A second run has the authors' own terms as its base model: the answer is held against its simulation.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.io import loadmat

from impactcell.campaign import Campaign, Coordinate, Excitation, write
from impactcell.records import Capture, Channel, Samples
from tests.benchmarks.table import Table

ROWS = Path("bench-results/discrepancy-real.jsonl")
README = Path("impactcell/discrepancy/README.md")
MARKS = "<!-- real records: from here -->", "<!-- real records: to here -->"
"""Between which the table stands in it."""
STEP_S = 1e-3
"""Sampling of the free pendulum [s]."""
TORQUE_CONSTANT, RESISTANCE, FULL_SCALE = 0.387, 4.02, 885.0
"""Of the servo: N m/A, ohm, and its full pulse width."""
ROTOR_KG_M2, BOB_KG, ARM_M = 0.0018, 0.49, 0.1
"""Servo's rotor beyond its gear, and what it lifts."""
GRAVITY = 9.81
KEPT = (
    "verdict", "headline", "effects", "unconfirmed", "remaining", "gap", "simulation", "nominal", "blocks",
    "notes",
)  # fmt: skip
"""Keys of `result.json` that a row keeps."""
BY_PRESSURE = {"term": "covariate_force", "covariate": "pressure_bar"}
"""Force of a pressure on a piston."""


@dataclass(frozen=True)
class Motion:
    """Position and driving force of one record; no force where nothing drives."""

    time_s: Samples
    position: Samples
    force: Samples | None
    batch: str | None = None
    covariates: dict[str, float | str] = field(default_factory=dict)


@dataclass(frozen=True)
class RealSet:
    """One set: how it is read, its base model, and what people found in it.

    Attributes
    ----------
    read : callable
    base : dict
        Content of the base model.
    authors : list
        Terms of the authors' own model.
    right : set of str
        Terms that people found; any of them is right.
    beside : set of str
        Terms that may stand beside them.
    """

    read: Callable[[Path], Iterator[Motion]]
    base: dict[str, Any]
    authors: list[Any]
    right: set[str]
    beside: set[str]


def free_pendulum(folder: Path) -> Iterator[Motion]:
    """Six pieces of one free swing; the angle counts from hanging down."""
    content = loadmat(str(folder / "free-pendulum" / "SinglePendulumDataForParameterEstimation.mat"))
    for piece in [piece for name in ("Y_id", "Y_vad") for piece in content[name].ravel()]:
        angle = piece[0] - np.pi
        yield Motion(STEP_S * np.arange(angle.size), angle, None)


def servo_pendulum(folder: Path) -> Iterator[Motion]:
    """Sixteen logs; the torque follows from pulse width, supply and speed."""
    for file in sorted((folder / "servo-pendulum").glob("*.json")):
        log = json.loads(file.read_text(encoding="utf-8"))
        angle, speed, volts, stamp = (
            np.array([float(entry[name]) for entry in log["entries"]])
            for name in ("position", "speed", "input_volts", "timestamp")
        )
        load = np.array([entry["load"] for entry in log["entries"]], dtype=np.int64)
        load = np.where(load >= 1 << 15, load - (1 << 16), load) / FULL_SCALE
        enabled = np.array([bool(entry["torque_enable"]) for entry in log["entries"]])
        motor = TORQUE_CONSTANT * (load * volts - TORQUE_CONSTANT * speed) / RESISTANCE * enabled
        time_s, kept = np.unique(stamp - stamp[0], return_index=True)
        yield Motion(time_s, angle[kept], motor[kept], batch=log["trajectory"])


def seal(name: str) -> Callable[[Path], Iterator[Motion]]:
    """Read one seal: a record a pressure, pulled to and fro."""

    def read(folder: Path) -> Iterator[Motion]:
        for bar in (1, 3, 5, 7):
            table = np.genfromtxt(folder / "pneumatic-seal" / f"{name}_{bar}bar.csv", delimiter="\t")
            pressure: dict[str, float | str] = {"pressure_bar": float(table[:, 5].mean())}
            yield Motion(1e-3 * table[:, 0], 1e-3 * table[:, 4], table[:, 6], covariates=pressure)

    return read


SEAL: dict[str, Any] = {
    "coordinate": "translation", "excitation": "driven", "predicts": "force", "mass_kg": 0.0,
    "terms": ["coulomb_friction", BY_PRESSURE], "nuisances": {"force_offset": {"std": "free"}},
}  # fmt: skip
"""Quasi-static: a mass is of no account."""
SETS: dict[str, RealSet] = {
    "free-pendulum": RealSet(
        free_pendulum,
        {
            "coordinate": "rotation", "excitation": "free", "inertia_kg_m2": 1.0,
            "gravity_torque_n_m": {"value": 60.0, "std": "free"}, "terms": ["coulomb_friction"],
            "nuisances": {"position_offset": {"std": 0.05}, "force_offset": {"std": 0.5}},
        },
        ["viscous_friction"],
        {"quadratic_drag"},
        {"viscous_friction"},
    ),
    "servo-pendulum": RealSet(
        servo_pendulum,
        {
            "coordinate": "rotation", "excitation": "driven", "predicts": "force",
            "inertia_kg_m2": {"value": BOB_KG * ARM_M**2 + ROTOR_KG_M2, "std": 0.0007},
            "gravity_torque_n_m": BOB_KG * GRAVITY * ARM_M,
            "terms": ["coulomb_friction", "viscous_friction"],
            "nuisances": {
                "position_offset": {"std": 0.05}, "force_offset": {"std": 0.02},
                "force_gain": {"std": 0.3}, "delay_s": {"std": 0.01},
            },
        },
        ["coulomb_friction", "viscous_friction"],
        {"load_dependent_friction"},
        {"stribeck_friction"},
    ),
    **{
        f"seal-{name}": RealSet(
            seal(name),
            SEAL,
            ["coulomb_friction", BY_PRESSURE],
            {"covariate_friction"},
            {"presliding_hysteresis"},
        )
        for name in ("PK", "O-ring", "KDN")
    },
}  # fmt: skip


def _noisy(motion: Motion) -> Motion:
    noise = 0.5 * float(np.std(np.diff(motion.position, 3)) / np.sqrt(20.0)) + 1e-4 * float(
        np.ptp(motion.position)
    )
    return replace(
        motion,
        position=motion.position + noise * np.random.default_rng(1).standard_normal(motion.position.size),
    )


def _outliers(motion: Motion) -> Motion:
    rng = np.random.default_rng(2)
    position = motion.position.copy()
    places = rng.choice(position.size, position.size // 200, replace=False)
    position[places] += 0.2 * np.ptp(position) * rng.choice([-1.0, 1.0], places.size)
    return replace(motion, position=position)


def _every(motion: Motion, step: int) -> Motion:
    return replace(
        motion,
        time_s=motion.time_s[::step],
        position=motion.position[::step],
        force=None if motion.force is None else motion.force[::step],
    )


def _late(motion: Motion) -> Motion:
    if motion.force is None:
        return motion
    late = 4.0 * float(np.median(np.diff(motion.time_s)))
    return replace(motion, force=np.interp(motion.time_s - late, motion.time_s, motion.force))


def heavier(base: dict[str, Any]) -> dict[str, Any]:
    """Return a base model whose mass is off by 10 %; of the seals, which have none, half a kilogram off."""
    if "mass_kg" in base:
        return base | {"mass_kg": 0.5}

    def scaled(number: dict[str, Any] | float) -> dict[str, Any] | float:
        return number | {"value": 1.1 * number["value"]} if isinstance(number, dict) else 1.1 * number

    return base | {name: scaled(base[name]) for name in ("inertia_kg_m2", "gravity_torque_n_m")}


WAYS: dict[str, Callable[[list[Motion]], list[Motion]]] = {
    "as_it_is": lambda motions: motions,
    "half_the_data": lambda motions: motions[::2],
    "other_rate": lambda motions: [_every(motion, 2) for motion in motions],
    "more_noise": lambda motions: [_noisy(motion) for motion in motions],
    "outliers": lambda motions: [_outliers(motion) for motion in motions],
    "late_channel": lambda motions: [_late(motion) for motion in motions],
    "mass_off": lambda motions: motions,
}
"""The set itself, and disturbed in six ways; of the last it is the base model."""


def campaign(motions: list[Motion], base: dict[str, Any]) -> Campaign:
    """Records of one machine; no noise is stated."""
    captures = [
        Capture(
            number,
            float("nan"),
            float("nan"),
            None if motion.force is None else Channel(motion.time_s, motion.force, None),
            Channel(motion.time_s, motion.position, None),
            batch_id=motion.batch,
            covariates=motion.covariates,
        )
        for number, motion in enumerate(motions, 1)
    ]
    columns = ("shot", *(("batch",) if motions[0].batch else ()), *motions[0].covariates)
    return Campaign(
        Excitation.DRIVEN if base["excitation"] == "driven" else Excitation.FREE_SLIDE,
        tuple(captures),
        columns=columns,
        coordinate=Coordinate(base["coordinate"]),
    )


def run(motions: list[Motion], base: dict[str, Any], authors: list[Any], seed: int = 0) -> dict[str, Any]:
    """What the command line says of a set, and how far off the authors' own terms simulate it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(campaign(motions, base), folder / "campaign")
        started = time.perf_counter()
        result = _discrepancy(folder, base, seed)
        seconds = round(time.perf_counter() - started, 1)
        if "verdict" in result and result["verdict"] == "refused":
            return result | {"seconds": seconds}
        own = _discrepancy(folder, base | {"terms": authors}, seed)
    kept = {key: result[key] for key in KEPT}
    return kept | {"authors_rmse": own["simulation"]["rmse"]["before"], "seconds": seconds}


def _discrepancy(folder: Path, base: dict[str, Any], seed: int) -> dict[str, Any]:
    (folder / "base.yaml").write_text(yaml.safe_dump({"format": 1} | base), encoding="utf-8")
    command = [sys.executable, "-m", "impactcell", "discrepancy", "-q", str(folder / "campaign")]
    command += ["-o", str(folder / "found"), "--base", str(folder / "base.yaml"), "--seed", str(seed)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode:
        return {"verdict": "refused", "headline": ran.stderr.strip()}
    content: dict[str, Any] = json.loads((folder / "found" / "result.json").read_text(encoding="utf-8"))
    return content


def is_honest(row: dict[str, Any]) -> bool:
    """Rules that hold whatever the answer: no gap only at the floor, no name without a fall of the gap."""
    if row["verdict"] in {"refused", "untested"}:
        return True
    gap = row["gap"]["held_out"]
    at_floor = gap["before"] <= gap["expected_without_gap"][1]
    falls = all(one["held_out"]["closed_ci95"][0] > 0.0 for one in row["effects"])
    return falls and (row["verdict"] != "no_gap" or at_floor)


def is_right(row: dict[str, Any]) -> bool:
    """Whether what is established is what people found, or tied with it."""
    real = SETS[row["set"]]
    groups = [{_bare(name) for name in (one["effect"], *one["tied_with"])} for one in row.get("effects", [])]
    return any(group & real.right for group in groups) and not is_wrong(row)


def is_wrong(row: dict[str, Any]) -> bool:
    """Whether anything is established that people did not find."""
    real = SETS[row["set"]]
    groups = [{_bare(name) for name in (one["effect"], *one["tied_with"])} for one in row.get("effects", [])]
    return any(not group & (real.right | real.beside) for group in groups)


def _bare(name: str) -> str:
    """Identifier of a term without its column."""
    return name.partition("(")[0]


def table(found: list[dict[str, Any]]) -> Table:
    """A line a run."""
    lines = []
    for row in found:
        names = [" or ".join([one["effect"], *one["tied_with"]]) for one in row.get("effects", [])]
        gap = row["gap"]["held_out"] if "gap" in row else {"before": np.nan, "after": np.nan}
        after = row["simulation"]["rmse"]["after"] if "simulation" in row else np.nan
        lines.append(
            [
                row["set"], row["way"].replace("_", " "), row["verdict"], ", then ".join(names),
                f"{gap['before']:.3g} to {gap['after']:.3g}",
                f"{after / row['authors_rmse']:.2f}" if "authors_rmse" in row else "",
                "yes" if is_honest(row) else "**no**",
                "**wrong name**" if is_wrong(row) else "yes" if is_right(row) else "no",
            ]
        )  # fmt: skip
    columns = (
        "set",
        "disturbed by",
        "verdict",
        "established",
        "held-out gap",
        "error over the authors'",
        "honest",
        "right",
    )
    return Table("Discrepancy: real records", columns, lines)


def main() -> None:
    """Run what the arguments say, then print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("data", type=Path, help="folder with the sets")
    parser.add_argument("--set", action="append", choices=[*SETS], help="only this set; may be repeated")
    parser.add_argument("--way", action="append", choices=[*WAYS], help="only this way; may be repeated")
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--table", action="store_true", help="only print the table of the rows there are")
    parser.add_argument("--readme", action="store_true", help="write it into the workflow's README too")
    given = parser.parse_args()
    given.rows.parent.mkdir(parents=True, exist_ok=True)
    given.rows.touch()
    found = [json.loads(line) for line in given.rows.read_text(encoding="utf-8").splitlines()]
    done = {(row["set"], row["way"]) for row in found}
    tasks = [(name, way) for way in given.way or WAYS for name in given.set or SETS]
    for name, way in [] if given.table else [task for task in tasks if task not in done]:
        real = SETS[name]
        motions = WAYS[way](list(real.read(given.data)))
        base = heavier(real.base) if way == "mass_off" else real.base
        found.append({"set": name, "way": way} | run(motions, base, real.authors))
        with given.rows.open("a", encoding="utf-8") as file:
            file.write(json.dumps(found[-1]) + "\n")
    found.sort(key=lambda row: ([*WAYS].index(row["way"]), [*SETS].index(row["set"])))
    text = table(found).markdown()
    print(text)
    if given.readme:
        write_to_readme(text, missing=len(WAYS) * len(SETS) - len(found))


def write_to_readme(text: str, missing: int) -> None:
    """Put the table between its marks in the workflow's README."""
    before, _, rest = README.read_text(encoding="utf-8").partition(MARKS[0])
    _, _, after = rest.partition(MARKS[1])
    told = f"{missing} of {len(WAYS) * len(SETS)} runs have not been made." if missing else "All runs."
    README.write_text(f"{before}{MARKS[0]}\n#{text}\n{told}\n{MARKS[1]}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
