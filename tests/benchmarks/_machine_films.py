"""Machines by a base model: free swings in films, whose noise outweighs what slows them down.

`python -m tests.benchmarks._machine_films [--seeds N]` films a bob on a string at 30 frames a second, by
scipy's integrator, and asks what its base model of gravity alone lacks. It adds rows to `--rows` and goes
on where it ended; `--table` only prints. Seeds of the report are from 1 080 000 on, those of `--tuning` below
1000.
"""

import argparse
import itertools
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import BaseModel, MachineFinding, NumberPrior, investigate_machine
from impactcell.records import Capture, Channel
from tests.benchmarks.table import Table

ROWS = Path("bench-results/machine-films.jsonl")
REPORTING = 1_080_000
GRAVITY, RATE_HZ, SECONDS = 29.4, 30.0, 30.0
"""m g l over the inertia [1/s²], frames a second, and how long a film is."""
RELEASED = (1.0, 0.85, 0.7)
"""From where the films of a bob begin [rad]."""
Torque = Callable[[float], float]
HIDDEN: dict[str, tuple[str, float]] = {
    "nothing": ("", 0.0),
    "viscous, 0.02": ("viscous_friction", 0.02),
    "viscous, 0.1": ("viscous_friction", 0.1),
    "drag, 0.02": ("quadratic_drag", 0.02),
    "drag, 0.1": ("quadratic_drag", 0.1),
    "Coulomb, 0.05": ("coulomb_friction", 0.05),
}
"""What slows the bob down, over its inertia."""
TORQUES: dict[str, Torque] = {
    "": lambda speed: 0.0,
    "viscous_friction": lambda speed: -speed,
    "quadratic_drag": lambda speed: -speed * abs(speed),
    "coulomb_friction": lambda speed: -math.tanh(speed / 1e-3),
}
NOISES = (3e-3, 1e-2)
"""Of an angle in a frame [rad]."""
FILMS = (1, 3)


def films(hidden: str, noise: float, count: int, seed: int) -> Campaign:
    """Films of one bob."""
    name, strength = HIDDEN[hidden]
    time = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    rng = np.random.default_rng([seed, 4])

    def rates(_: float, state: np.ndarray) -> tuple[float, float]:
        return state[1], -GRAVITY * math.sin(state[0]) + strength * TORQUES[name](state[1])

    shots = []
    for number, released in enumerate(RELEASED[:count], 1):
        swing = solve_ivp(
            rates, (0.0, SECONDS), (released, 0.0), t_eval=time, rtol=1e-9, atol=1e-11, max_step=0.02
        )
        angle = Channel(time, swing.y[0] + rng.normal(0.0, noise, time.size))
        shots.append(Capture(number, math.nan, math.nan, None, angle))
    return Campaign(Excitation.FREE_SLIDE, tuple(shots), coordinate=Coordinate.ROTATION)


def run(plan: dict[str, Any]) -> dict[str, Any]:
    """One row of the study."""
    base = BaseModel(
        coordinate=Coordinate.ROTATION,
        inertia=NumberPrior(1.0),
        gravity_torque=NumberPrior(GRAVITY, math.inf),
        terms=(),
    )
    given = films(plan["hidden"], plan["noise"], plan["films"], plan["seed"])
    finding = investigate_machine(given, base, seed=plan["seed"])
    return plan | {
        "verdict": finding.verdict,
        "established": {name: list(finding.tied_with[name]) for name in finding.established},
        "hints": [one.name for one in finding.clear_strengths],
        "gap": [finding.fall.before, finding.fall.after],
        "rmse": [error.rmse for error in finding.simulated],
        "inside": _is_inside(finding, *HIDDEN[plan["hidden"]]),
    }


def _is_inside(finding: MachineFinding, name: str, strength: float) -> bool | None:
    """Whether the interval of what is hidden holds it; None where it is not named, or tied behind another."""
    fit = finding.final.fit
    for low, high, column in zip(fit.low, fit.high, fit.columns, strict=True):
        if name and column[0] == name and name in finding.established:
            return bool(low <= strength <= high)
    return None


def table(found: list[dict[str, Any]]) -> Table:
    """Rows by what is hidden, its noise and how many films there are."""
    lines = []
    for hidden, noise, count in itertools.product(HIDDEN, NOISES, FILMS):
        rows = [row for row in found if (row["hidden"], row["noise"], row["films"]) == (hidden, noise, count)]
        if not rows:
            continue
        name = HIDDEN[hidden][0]
        named = [[{one, *rivals} for one, rivals in row["established"].items()] for row in rows]
        right = [any(name in group for group in groups) for groups in named]
        alone = sum({name} in groups for groups in named)
        wrong = sum(any(name not in group for group in groups) for groups in named)
        hinted = sum(not groups and bool(row["hints"]) for groups, row in zip(named, rows, strict=True))
        silent = sum(row["verdict"] == "no_gap" for row in rows)
        inside = [row["inside"] for row in rows if row["inside"] is not None]
        gaps = " to ".join(f"{np.mean([row['gap'][when] for row in rows]):.2f}" for when in (0, 1))
        lines.append(
            [
                hidden,
                f"{1e3 * noise:g} mrad, {count}",
                f"{sum(right)}/{len(rows)}, {alone}" if name else "",
                f"{wrong}/{len(rows)}",
                f"{hinted}/{len(rows)}",
                f"{silent}/{len(rows)}",
                gaps,
                f"{sum(inside)}/{len(inside)}" if inside else "",
            ]
        )
    heads = (
        "hidden", "noise, films", "named or tied, named alone", "anything else", "a strength is told",
        "no_gap", "mean gap", "inside its interval",
    )  # fmt: skip
    note = f"{len(found)} campaigns of films of {SECONDS:g} s at {RATE_HZ:g} frames a second, from 1 rad."
    return Table("Machines by a base model: films of a swing", heads, lines, note)


def main() -> None:
    """Run what the arguments say, then print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument(
        "--tuning", action="store_true", help="seeds that numbers of the method may be set on"
    )
    parser.add_argument("--table", action="store_true", help="only print the table of the rows there are")
    given = parser.parse_args()
    given.rows.parent.mkdir(parents=True, exist_ok=True)
    given.rows.touch()
    found = [json.loads(line) for line in given.rows.read_text(encoding="utf-8").splitlines()]
    keys = ("hidden", "noise", "films", "seed")
    done = {tuple(row[key] for key in keys) for row in found}
    first = 0 if given.tuning else REPORTING
    seeds = range(first, first + given.seeds)
    plans = [dict(zip(keys, plan, strict=True)) for plan in itertools.product(HIDDEN, NOISES, FILMS, seeds)]
    for plan in [] if given.table else [plan for plan in plans if tuple(plan.values()) not in done]:
        found.append(run(plan))
        with given.rows.open("a", encoding="utf-8") as file:
            file.write(json.dumps(found[-1]) + "\n")
    print(table(found).markdown())


if __name__ == "__main__":
    main()
