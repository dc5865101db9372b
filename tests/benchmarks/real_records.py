"""Discrepancy workflow on records of real machines, through its command line, as they are and disturbed.

`python -m tests.benchmarks.real_records DATA [--set NAME] [--way NAME] [--rows FILE]` converts what others
have measured (folders `free-pendulum` and `servo-pendulum` of DATA) to campaigns, runs `impactcell
discrepancy` on them and appends a row to `--rows`; what is there already is not done again. A rotation is
written as a motion along an axis: rad for m, N m for N, kg m² for kg; the torque of gravity at the measured
angle is part of the drive.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from impactcell.campaign import Campaign, Excitation, write
from impactcell.records import Capture, Channel, Samples
from tests.benchmarks.table import Table

ROWS = Path("bench-results/discrepancy-real.jsonl")
PENDULUM_RATE_SQUARED = 63.9
"""g over the reduced length of the free pendulum [1/s²]: its small swings."""
STEP_S = 1e-3
"""Sampling of the free pendulum [s]."""
TORQUE_CONSTANT, RESISTANCE, FULL_SCALE = 0.387, 4.02, 885.0
"""Of the servo: N m/A, ohm, and its full pulse width."""
ROTOR_KG_M2, BOB_KG, ARM_M = 0.0018, 0.49, 0.1
"""Servo's rotor beyond its gear, and what it lifts."""
GRAVITY = 9.81
RIGHT = {
    "free-pendulum": {"quadratic_drag"},
    "servo-pendulum": {"load_dependent_friction", "stribeck_friction"},
}
"""What people have found in the sets; viscous friction at most beside it."""


KEPT = (
    "verdict", "headline", "effects", "unconfirmed", "remaining", "gap", "simulation", "nominal", "notes",
)  # fmt: skip
"""Keys of `result.json` that a row keeps."""


@dataclass(frozen=True)
class Motion:
    """Position and driving force of one record, with what moves."""

    time_s: Samples
    position: Samples
    force: Samples
    mass: float


def free_pendulum(folder: Path) -> Iterator[Motion]:
    """Six pieces of one free swing; gravity at the measured angle is the drive of a unit inertia."""
    content = loadmat(str(folder / "SinglePendulumDataForParameterEstimation.mat"))
    pieces = [piece for name in ("Y_id", "Y_vad") for piece in content[name].ravel()]
    zero = _resting_angle(pieces[-1][0])
    for piece in pieces:
        angle = piece[0] - zero
        time_s = STEP_S * np.arange(angle.size)
        yield Motion(time_s, angle, -PENDULUM_RATE_SQUARED * np.sin(angle), 1.0)


def _resting_angle(angle: Samples) -> float:
    """Mean over whole swings at the end of a record: from one upward crossing of its median to the last."""
    above = angle > np.median(angle)
    upward = np.flatnonzero(~above[:-1] & above[1:])
    return float(angle[upward[-5] : upward[-1]].mean())


def servo_pendulum(folder: Path) -> Iterator[Motion]:
    """Sixteen logs; the torque follows from pulse width, supply and speed."""
    for file in sorted(folder.glob("*.json")):
        entries = json.loads(file.read_text(encoding="utf-8"))["entries"]
        angle, speed, volts, stamp = (
            np.array([float(entry[name]) for entry in entries])
            for name in ("position", "speed", "input_volts", "timestamp")
        )
        load = np.array([entry["load"] for entry in entries], dtype=np.int64)
        load = np.where(load >= 1 << 15, load - (1 << 16), load) / FULL_SCALE
        enabled = np.array([bool(entry["torque_enable"]) for entry in entries])
        motor = TORQUE_CONSTANT * (load * volts - TORQUE_CONSTANT * speed) / RESISTANCE * enabled
        gravity = BOB_KG * GRAVITY * ARM_M * np.sin(angle)
        time_s, kept = np.unique(stamp - stamp[0], return_index=True)
        yield Motion(time_s, angle[kept], (motor - gravity)[kept], BOB_KG * ARM_M**2 + ROTOR_KG_M2)


SETS: dict[str, Callable[[Path], Iterator[Motion]]] = {
    "free-pendulum": free_pendulum,
    "servo-pendulum": servo_pendulum,
}


def _noisy(motion: Motion) -> Motion:
    noise = 0.5 * float(np.std(np.diff(motion.position, 3)) / np.sqrt(20.0)) + 1e-4
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
        motion, time_s=motion.time_s[::step], position=motion.position[::step], force=motion.force[::step]
    )


def _late(motion: Motion) -> Motion:
    late = 4.0 * float(np.median(np.diff(motion.time_s)))
    return replace(motion, force=np.interp(motion.time_s - late, motion.time_s, motion.force))


WAYS: dict[str, Callable[[list[Motion]], list[Motion]]] = {
    "as_it_is": lambda motions: motions,
    "half_the_data": lambda motions: motions[::2],
    "other_rate": lambda motions: [_every(motion, 2) for motion in motions],
    "more_noise": lambda motions: [_noisy(motion) for motion in motions],
    "outliers": lambda motions: [_outliers(motion) for motion in motions],
    "late_channel": lambda motions: [_late(motion) for motion in motions],
    "mass_off": lambda motions: [replace(motion, mass=1.1 * motion.mass) for motion in motions],
}
"""The set itself, and disturbed in six ways."""


def campaign(motions: list[Motion]) -> Campaign:
    """Records of a driven part; no noise is stated."""
    captures = [
        Capture(
            number,
            float("nan"),
            motion.mass,
            Channel(motion.time_s, motion.force, None),
            Channel(motion.time_s, motion.position, None),
        )
        for number, motion in enumerate(motions, 1)
    ]
    return Campaign(Excitation.DRIVEN, tuple(captures), columns=("shot", "mass_kg"))


def run(motions: list[Motion], seed: int = 0) -> dict[str, Any]:
    """What the command line says of a set."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(campaign(motions), folder / "campaign")
        started = time.perf_counter()
        command = [sys.executable, "-m", "impactcell", "discrepancy", "-q", str(folder / "campaign")]
        command += ["-o", str(folder / "found"), "--seed", str(seed)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        seconds = round(time.perf_counter() - started, 1)
        if done.returncode:
            return {"verdict": "refused", "headline": done.stderr.strip(), "seconds": seconds}
        result = json.loads((folder / "found" / "result.json").read_text(encoding="utf-8"))
    return {key: result[key] for key in KEPT} | {"seconds": seconds}


def is_honest(row: dict[str, Any]) -> bool:
    """Rules that hold whatever the answer: no gap only at the floor, no name without a fall of the gap."""
    if row["verdict"] in {"refused", "untested"}:
        return True
    gap = row["gap"]["held_out"]
    at_floor = gap["before"] <= gap["expected_without_gap"][1]
    falls = all(one["held_out"]["closed_ci95"][0] > 0.0 for one in row["effects"])
    return falls and (row["verdict"] != "no_gap" or at_floor)


def table(found: list[dict[str, Any]]) -> Table:
    """A line a run."""
    lines = []
    for row in found:
        names = [" or ".join([one["effect"], *one["tied_with"]]) for one in row.get("effects", [])]
        gap = row["gap"]["held_out"] if "gap" in row else {"before": np.nan, "after": np.nan}
        error = row["simulation"]["rmse"] if "simulation" in row else {"before": np.nan, "after": np.nan}
        lines.append(
            [
                row["set"], row["way"], row["verdict"], ", then ".join(names),
                f"{gap['before']:.3g} to {gap['after']:.3g}",
                f"{error['before']:.3g} to {error['after']:.3g}",
                "yes" if is_honest(row) else "**no**",
            ]
        )  # fmt: skip
    columns = (
        "set",
        "disturbed by",
        "verdict",
        "established",
        "held-out gap",
        "RMSE, rad",
        "honest",
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
    given = parser.parse_args()
    given.rows.parent.mkdir(parents=True, exist_ok=True)
    given.rows.touch()
    found = [json.loads(line) for line in given.rows.read_text(encoding="utf-8").splitlines()]
    done = {(row["set"], row["way"]) for row in found}
    tasks = [(name, way) for way in given.way or WAYS for name in given.set or SETS]
    for name, way in [] if given.table else [task for task in tasks if task not in done]:
        motions = WAYS[way](list(SETS[name](given.data / name)))
        found.append({"set": name, "way": way} | run(motions))
        with given.rows.open("a", encoding="utf-8") as file:
            file.write(json.dumps(found[-1]) + "\n")
    print(table(found).markdown())


if __name__ == "__main__":
    main()
