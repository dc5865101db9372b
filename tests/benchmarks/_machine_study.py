"""Machines by a base model: nothing hidden in five classes of noise, a term, a model error, and both.

`python -m tests.benchmarks._machine_study [--campaigns N]` adds rows to `--rows` and goes on where it ended;
`--table` only prints. Two machines take turns: a pendulum that swings freely, integrated here, and a slide
that is held to a path, whose force follows from its law. Seeds of the report are from 1 340 000 on, those on
which numbers of the method may be set (`--tuning`) from 800 000 on.
"""

import argparse
import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import (
    BaseModel,
    MachineFinding,
    NumberPrior,
    Response,
    TermChoice,
    investigate_machine,
)
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.fits.proof import gap as held_out_gap
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.terms.law_terms import SMOOTH_LAW
from impactcell.records import Capture, Channel, Samples
from tests.benchmarks.table import Table

ROWS = Path("bench-results/machines.jsonl")
REPORTING, TUNING = 1_340_000, 800_000
"""First seeds."""
CLOSED_GAP = 1.2
"""Gap up to which a law leaves nothing, in noise floors."""
LAW_SEEDS = 50_000
"""By how much later the seeds of the study of laws begin."""
KINDS = ("nothing", "one", "model_error", "beside_model_error")
"""What a campaign hides: one after the other."""
NOISES = ("white", "correlated", "heavy_tailed", "quantised", "outliers")
GAPS, LEVELS = (1.5, 6.0), (0.2, 2.0)
"""Gap of the hidden term alone, and model error alone [1 = noise floor], even in their logarithms."""
CALIBRATING_STEPS, CALIBRATED = 6, 0.1
"""Steps at most to a strength, and how near in its logarithm the excess over the noise may come to rest."""
Law = Callable[[Samples, Samples, Samples], Samples]
"""Generalised force of position, velocity and direction of motion."""
HIDDEN: dict[str, Law] = {
    "viscous_friction": lambda q, v, s: -v,
    "quadratic_drag": lambda q, v, s: -v * np.abs(v),
    "position_dependent_friction": lambda q, v, s: -q * s,
    "stribeck_friction": lambda q, v, s: -np.exp(-((v / 0.12) ** 2)) * s,
    "hardening_spring": lambda q, v, s: -(q**3),
    "directional_viscous_friction": lambda q, v, s: -np.abs(v),
}
"""What may be hidden, per unit of its strength."""
UNLISTED: dict[str, tuple[str, Callable[[float, float], Law]]] = {
    "bump_of_friction": (
        "friction_over_position",
        lambda reach, fastest: lambda q, v, s: -s * np.exp(-0.5 * ((q / reach - 0.2) / 0.25) ** 2),
    ),
    "root_of_speed": ("friction_over_speed", lambda reach, fastest: lambda q, v, s: -s * np.abs(v) ** 0.5),
    "threshold_of_speed": (
        "friction_over_speed",
        lambda reach, fastest: lambda q, v, s: -s * np.maximum(np.abs(v) - 0.4 * fastest, 0.0),
    ),
    "saturating_spring": (
        "force_over_position", lambda reach, fastest: lambda q, v, s: -np.tanh(q / (0.3 * reach))
    ),
    "bump_of_force": (
        "force_over_position",
        lambda reach, fastest: lambda q, v, s: np.exp(-0.5 * ((q / reach + 0.3) / 0.2) ** 2),
    ),
}  # fmt: skip
"""Laws that the catalogue does not have: place, and law by farthest position and largest speed."""


@dataclass(frozen=True)
class Machine:
    """One machine: base model, law, noise of what is predicted, farthest position and largest speed."""

    base: BaseModel
    inertia: float
    gravity: float
    coulomb: float
    noise: float
    reach: float
    fastest: float


PENDULUM = Machine(
    BaseModel(
        coordinate=Coordinate.ROTATION, inertia=NumberPrior(0.02), gravity_torque=NumberPrior(0.55, math.inf),
        position_offset=NumberPrior(0.0, 0.05), force_offset=NumberPrior(0.0, 0.01),
    ),
    0.02, 0.6, 0.002, 2e-5, 1.2, 6.0,
)  # fmt: skip
SLIDE = Machine(
    BaseModel(
        response=Response.FORCE, inertia=NumberPrior(2.0, 0.1), force_offset=NumberPrior(0.0, math.inf)
    ),
    2.0, 0.0, 3.0, 0.2, 0.2, 1.0,
)  # fmt: skip


def campaign(machine: Machine, law: Law, noise: str, seed: int) -> Campaign:
    """Six records of a machine with a law beside its own."""
    rng = np.random.default_rng([seed, 1])
    time_s, q, v, a = _swings(machine, law, rng) if machine.gravity else _paths(rng)
    shots = []
    for place in range(q.shape[1]):
        position, force = q[:, place], None
        if machine.gravity:
            position = position + machine.noise * _drawn(noise, position.size, rng)
        else:
            direction = np.tanh(v[:, place] / 1e-3)
            values = machine.inertia * a[:, place] + machine.coulomb * direction
            values -= law(position, v[:, place], direction)
            force = Channel(time_s, values + machine.noise * _drawn(noise, values.size, rng), None)
        shots.append(Capture(place + 1, math.nan, math.nan, force, Channel(time_s, position, None)))
    excitation = Excitation.FREE_SLIDE if machine.gravity else Excitation.DRIVEN
    return Campaign(excitation, tuple(shots), coordinate=machine.base.coordinate)


def _drawn(noise: str, count: int, rng: np.random.Generator) -> Samples:
    """Noise of about unit size in one of the classes."""
    white = rng.standard_normal(count)
    if noise == "correlated":
        for place in range(1, count):
            white[place] = 0.6 * white[place - 1] + 0.8 * white[place]
    elif noise == "heavy_tailed":
        white = rng.standard_t(3, count) / math.sqrt(3.0)
    elif noise == "quantised":
        white = white + rng.uniform(-1.0, 1.0, count)
    elif noise == "outliers":
        white[rng.random(count) < 0.003] += 200.0
    return white


def _paths(rng: np.random.Generator) -> tuple[Samples, Samples, Samples, Samples]:
    """Sums of three sines that a drive holds the slide to."""
    time_s = np.arange(0.0, 12.0, 4e-3)
    q, v, a = (np.zeros((time_s.size, 6)) for _ in range(3))
    for record in range(6):
        for _ in range(3):
            rate, phase = 2.0 * np.pi * rng.uniform(0.3, 1.2), rng.uniform(0.0, 2.0 * np.pi)
            size = 0.08 * rng.uniform(0.5, 1.0)
            q[:, record] += size * np.sin(rate * time_s + phase)
            v[:, record] += size * rate * np.cos(rate * time_s + phase)
            a[:, record] -= size * rate**2 * np.sin(rate * time_s + phase)
    return time_s, q, v, a


def _swings(
    machine: Machine, law: Law, rng: np.random.Generator
) -> tuple[Samples, Samples, Samples, Samples]:
    """Six free swings by the classical Runge-Kutta scheme."""
    step, parts = 2e-3, 2
    time_s = step * np.arange(4000)
    q, v = rng.uniform(0.7, 1.4, 6), np.zeros(6)
    out = np.empty((2, time_s.size, 6))

    def rates(q: Samples, v: Samples) -> tuple[Samples, Samples]:
        direction = np.tanh(v / 0.02)
        force = -machine.gravity * np.sin(q) - machine.coulomb * direction + law(q, v, direction)
        return v, force / machine.inertia

    h = step / parts
    for place in range(time_s.size):
        out[:, place] = q, v
        for _ in range(parts):
            k1 = rates(q, v)
            k2 = rates(q + 0.5 * h * k1[0], v + 0.5 * h * k1[1])
            k3 = rates(q + 0.5 * h * k2[0], v + 0.5 * h * k2[1])
            k4 = rates(q + h * k3[0], v + h * k3[1])
            q, v = (
                x + h / 6.0 * (one + 2.0 * two + 2.0 * three + four)
                for x, one, two, three, four in zip((q, v), k1, k2, k3, k4, strict=True)
            )
    return time_s, out[0], out[1], np.zeros_like(out[0])


def wandering(machine: Machine, seed: int) -> Law:
    """Smooth force of position and speed that no term has: four waves at random."""
    rng = np.random.default_rng([seed, 2])
    span, speed = (1.4, 7.0) if machine.gravity else (0.2, 0.8)
    waves = rng.uniform(-3.0, 3.0, (4, 2)) / np.array([span, speed])
    phases = rng.uniform(0.0, 2.0 * np.pi, 4)

    def law(q: Samples, v: Samples, direction: Samples) -> Samples:
        del direction
        total = np.zeros_like(q)
        for (along, over), phase in zip(waves, phases, strict=True):
            total = total + np.sin(along * q + over * v + phase)
        return total

    return law


def calibrated(machine: Machine, law: Law, gap: float, seed: int) -> float:
    """Find the strength at which a law alone makes a gap, in steps from a tenth of Coulomb friction.

    A spring that hardens needs more than two; of one that never settles, it is the nearest of the steps.
    """
    strength, wanted = 0.1 * machine.coulomb, math.sqrt(gap**2 - 1.0)
    off = dict[float, float]()
    while len(off) < CALIBRATING_STEPS and min(off.values(), default=math.inf) > CALIBRATED:
        left = _nominal_gap(campaign(machine, _times(law, strength), "white", seed), machine.base)
        excess = math.sqrt(max(left**2 - 1.0, 0.02))
        off[strength] = abs(math.log(excess / wanted))
        strength *= wanted / excess
    return min(off, key=off.__getitem__)


def _nominal_gap(given: Campaign, base: BaseModel) -> float:
    """Held-out gap of a base model alone."""
    fits = MachineFits(uniform_records(given, base), base, (), None)
    model = fits.fit(tuple(ChosenTerm(choice, 0.0) for choice in base.terms), settle=True)
    fits.weigh(model)
    return held_out_gap(fits.blocks()[1], fits.fit(model.terms, settle=False))


def _times(law: Law, strength: float) -> Law:
    return lambda q, v, s: strength * law(q, v, s)


def task(number: int, first: int) -> dict[str, Any]:
    """Plan of a campaign: kinds, noises and hidden terms take turns."""
    seed = first + number
    kind = KINDS[number % len(KINDS)]
    turn = number // len(KINDS)
    names = [*HIDDEN]
    return {
        "seed": seed,
        "kind": kind,
        "machine": "pendulum" if turn % 2 else "slide",
        "noise": NOISES[(turn // 2) % len(NOISES)] if kind == "nothing" else "white",
        "hidden": None if kind in ("nothing", "model_error") else names[(turn // 2) % len(names)],
    }


def law_task(number: int, first: int) -> dict[str, Any]:
    """Plan of a campaign with a law that nobody had listed: laws and machines take turns."""
    names = [*UNLISTED]
    return {
        "seed": first + LAW_SEEDS + number,
        "kind": "unlisted",
        "machine": "pendulum" if number % 2 else "slide",
        "noise": "white",
        "hidden": names[(number // 2) % len(names)],
    }


def run(plan: dict[str, Any]) -> dict[str, Any]:
    """One row of the study."""
    machine = PENDULUM if plan["machine"] == "pendulum" else SLIDE
    seed = plan["seed"]
    rng = np.random.default_rng([seed, 3])
    laws: list[Law] = []
    if plan["hidden"]:
        gap = math.exp(rng.uniform(*np.log(GAPS)))
        term = HIDDEN[plan["hidden"]] if plan["hidden"] in HIDDEN else _unlisted(plan["hidden"], machine)
        laws.append(_times(term, calibrated(machine, term, gap, seed)))
    if plan["kind"] in ("model_error", "beside_model_error"):
        level = math.exp(rng.uniform(*np.log(LEVELS)))
        error = wandering(machine, seed)
        laws.append(_times(error, calibrated(machine, error, math.hypot(1.0, level), seed)))

    def law(q: Samples, v: Samples, s: Samples) -> Samples:
        return sum((one(q, v, s) for one in laws), np.zeros_like(q))

    given = campaign(machine, law, plan["noise"], seed)
    started = time.process_time()
    base = replace(machine.base, terms=(TermChoice("coulomb_friction"),))
    finding = investigate_machine(given, base, seed=seed)
    return plan | _outcome(finding) | {"seconds": round(time.process_time() - started, 2)}


def _unlisted(name: str, machine: Machine) -> Law:
    return UNLISTED[name][1](machine.reach, machine.fastest)


def _outcome(finding: MachineFinding) -> dict[str, Any]:
    return {
        "verdict": finding.verdict,
        "established": list(finding.established),
        "tied": {name: list(rivals) for name, rivals in finding.tied_with.items()},
        "gap": [finding.fall.before, finding.fall.after],
        "rmse": [error.rmse for error in finding.simulated],
        "reason": finding.steps[-1].reason if finding.steps else "",
        "law": _law(finding),
    }


def _law(finding: MachineFinding) -> dict[str, Any]:
    """What was proposed where something remained, and what it does to the held-out simulation."""
    law = finding.law
    if law is None:
        return {"refused": finding.law_refused}
    row: dict[str, Any] = {"place": law.place, "gap": [law.fall.before, law.fall.after]}
    if law.simulated is not None:
        row["rmse"] = [error.rmse for error in law.simulated]
    if law.choice is not None and law.choice.law is not None:
        row |= {"form": law.choice.law.name, "equivalents": list(law.equivalents)}
    return row


def _in_one_place(row: dict[str, Any]) -> bool:
    """Whether a law in one place was proposed: a model error here is a force of position and velocity."""
    return row["law"].get("place", SMOOTH_LAW) != SMOOTH_LAW


def _as_smooth_force(row: dict[str, Any]) -> bool:
    """Whether what remains was told as a smooth force of velocity and position."""
    return bool(row["law"].get("place") == SMOOTH_LAW)


def table(found: list[dict[str, Any]]) -> Table:
    """Bars of the study."""

    def share(kind: str, what: Callable[[dict[str, Any]], bool], noise: str = "") -> list[str]:
        among = [row for row in found if row["kind"] == kind and noise in ("", row["noise"])]
        count = sum(map(what, among))
        if not among:
            return ["not run", ""]
        low, high = binomtest(count, len(among)).proportion_ci(method="wilson")
        return [f"{count}/{len(among)}", f"{100 * low:.1f} to {100 * high:.1f} %"]

    def groups(row: dict[str, Any]) -> list[set[str]]:
        return [{name, *row["tied"].get(name, [])} for name in row["established"]]

    def is_right(row: dict[str, Any]) -> bool:
        return any(row["hidden"] in group for group in groups(row))

    def is_wrong(row: dict[str, Any]) -> bool:
        return any(row["hidden"] not in group for group in groups(row))

    lines = [
        ["one hidden: established", "", *share("one", is_right)],
        ["one hidden: anything else established", "5 %", *share("one", is_wrong)],
        ["one hidden: no gap said", "", *share("one", lambda row: row["verdict"] == "no_gap")],
        ["beside model error: established", "85 %", *share("beside_model_error", is_right)],
        ["beside model error: anything else established", "5 %", *share("beside_model_error", is_wrong)],
        [
            "model error alone: something established",
            "5 %",
            *share("model_error", lambda row: bool(row["established"])),
        ],
        ["model error alone: a law in one place proposed", "", *share("model_error", _in_one_place)],
        ["model error alone: told as the smooth force it is", "", *share("model_error", _as_smooth_force)],
        *(
            [
                f"nothing hidden, {noise.replace('_', ' ')} noise: something established",
                "5 %",
                *share("nothing", lambda row: bool(row["established"]), noise),
            ]
            for noise in NOISES
        ),
    ]
    unlisted = [row for row in found if row["kind"] == "unlisted"]
    if unlisted:
        lines = _law_lines(unlisted, share)
    elif any("law" in row for row in found):
        lines.append(
            ["nothing hidden: a law proposed", "1 %", *share("nothing", lambda row: "place" in row["law"])]
        )
    note = f"{len(found)} campaigns of six records; hidden alone: gap 1.5 to 6, model error: 0.2 to 2 floors."
    return Table("Machines by a base model", ("what", "bar", "measured", "95 % interval"), lines, note)


def _law_lines(
    rows: list[dict[str, Any]], share: Callable[[str, Callable[[dict[str, Any]], bool]], list[str]]
) -> list[list[str]]:
    """Bars of the laws that nobody had listed."""

    def place(row: dict[str, Any]) -> str:
        return f"law_of_{UNLISTED[row['hidden']][0]}"

    def is_there(row: dict[str, Any]) -> bool:
        return bool(row["law"].get("place") == place(row))

    def is_told(row: dict[str, Any]) -> bool:
        return bool(row["established"]) or "place" in row["law"]

    def is_closed(row: dict[str, Any]) -> bool:
        gap: float = row["law"]["gap"][1] if "gap" in row["law"] else row["gap"][1]
        return gap <= CLOSED_GAP

    rises = sum("rmse" in row["law"] and row["law"]["rmse"][1] >= row["law"]["rmse"][0] for row in rows)
    return [
        ["held-out gap after, at most 1.2", "80 %", *share("unlisted", is_closed)],
        ["law at the right place", "", *share("unlisted", is_there)],
        ["a named term or a law", "", *share("unlisted", is_told)],
        ["held-out simulation errs more with the law", "0", f"{rises}/{len(rows)}", ""],
    ]


def main() -> None:
    """Run what the arguments say, then print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--campaigns", type=int, default=300)
    parser.add_argument(
        "--tuning", action="store_true", help="seeds that numbers of the method may be set on"
    )
    parser.add_argument("--laws", action="store_true", help="laws that the catalogue does not have")
    parser.add_argument("--table", action="store_true", help="only print the table of the rows there are")
    given = parser.parse_args()
    given.rows.parent.mkdir(parents=True, exist_ok=True)
    given.rows.touch()
    first = TUNING if given.tuning else REPORTING
    found = [json.loads(line) for line in given.rows.read_text(encoding="utf-8").splitlines()]
    seeds = {row["seed"] for row in found}
    plan_of = law_task if given.laws else task
    plans = [plan_of(number, first) for number in range(given.campaigns)]
    for plan in [] if given.table else [plan for plan in plans if plan["seed"] not in seeds]:
        found.append(run(plan))
        with given.rows.open("a", encoding="utf-8") as file:
            file.write(json.dumps(found[-1]) + "\n")
    print(table(found).markdown())


if __name__ == "__main__":
    main()
