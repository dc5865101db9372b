"""Machines whose base model holds what is off, or whose sensor errs: told, and taken for nothing else?

`python -m tests.benchmarks._machine_held [--campaigns 10]` takes the machines of `_machine_study` with
nothing hidden, of seeds from 980 000 on, and prints how often what is off is told with its size.
"""

import argparse
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Campaign
from impactcell.discrepancy.machine import BaseModel, MachineFinding, NumberPrior, investigate_machine
from impactcell.records import Capture, Channel, Samples
from tests.benchmarks._machine_study import PENDULUM, SLIDE, Machine, campaign
from tests.benchmarks.table import Table

SEEDS = 980_000
SIZE = 0.1
"""Relative error of the size that is told up to which it is right."""
OFF_CENTRE_RAD, ZERO_RAD, LATE_S, ZERO_N, SHARE = 1e-3, 0.02, 6e-3, 0.5, 0.05
"""How much each is off."""


@dataclass(frozen=True)
class Fault:
    """What is off: in the records, in the base model, what is to be told of it, and its size there."""

    machine: Machine
    base: Callable[[BaseModel], BaseModel]
    shot: Callable[[Capture], Capture]
    told: str
    size: float


def _moved(shot: Capture, move: Callable[[Samples, Samples], Samples]) -> Capture:
    assert shot.position is not None
    time_s, values = shot.position.time_s, shot.position.values
    return replace(shot, position=Channel(time_s, move(time_s, values), None))


def _pushed(shot: Capture, push: Callable[[Samples, Samples], Samples]) -> Capture:
    assert shot.force is not None
    time_s, values = shot.force.time_s, shot.force.values
    return replace(shot, force=Channel(time_s, push(time_s, values), None))


FAULTS: dict[str, Fault] = {
    "an encoder 1 mrad off its centre": Fault(
        PENDULUM, lambda base: base, lambda shot: _moved(shot, lambda _, q: q + OFF_CENTRE_RAD * np.cos(q)),
        r"encoder that turns (\S+) mrad off", 1e3 * OFF_CENTRE_RAD,
    ),
    "the zero of an angle, held, 20 mrad off": Fault(
        PENDULUM, lambda base: replace(base, position_offset=NumberPrior()),
        lambda shot: _moved(shot, lambda _, q: q + ZERO_RAD),
        r"zero of the angle (\S+) mrad off", 1e3 * ZERO_RAD,
    ),
    "a torque of gravity that is held 5 % too small": Fault(
        PENDULUM,
        lambda base: replace(base, gravity_torque=NumberPrior((1.0 - SHARE) * PENDULUM.gravity)),
        lambda shot: shot, r"torque of gravity (\S+) N m larger", SHARE * PENDULUM.gravity,
    ),
    "a mass that is held 5 % too large": Fault(
        SLIDE, lambda base: replace(base, inertia=NumberPrior((1.0 + SHARE) * SLIDE.inertia)),
        lambda shot: shot, r"mass (\S+) % smaller", 100.0 * SHARE / (1.0 + SHARE),
    ),
    "the zero of a force, held, 0.5 N off": Fault(
        SLIDE, lambda base: replace(base, force_offset=NumberPrior()),
        lambda shot: _pushed(shot, lambda _, force: force + ZERO_N), r"constant force of -(\S+) N", ZERO_N,
    ),
    "a force that is recorded 6 ms late": Fault(
        SLIDE, lambda base: base,
        lambda shot: _pushed(shot, lambda time, force: np.interp(time - LATE_S, time, force)),
        r"force recorded (\S+) ms late", 1e3 * LATE_S,
    ),
}  # fmt: skip


def investigated(fault: Fault, seed: int) -> MachineFinding:
    """Investigate one campaign of a machine of which something is off."""
    given = campaign(fault.machine, lambda q, _v, _s: np.zeros_like(q), "white", seed)
    spoilt = Campaign(
        given.excitation, tuple(fault.shot(shot) for shot in given.shots), coordinate=given.coordinate
    )
    return investigate_machine(spoilt, fault.base(fault.machine.base), seed=seed)


def is_told(fault: Fault, finding: MachineFinding) -> bool:
    """Whether a note tells what is off, and by how much."""
    found = [float(match[1]) for note in finding.notes if (match := re.search(fault.told, note))]
    return any(math.isclose(size, fault.size, rel_tol=SIZE) for size in found)


def table(campaigns: int) -> Table:
    """A row a fault."""
    rows = []
    for name, fault in FAULTS.items():
        found = [investigated(fault, SEEDS + number) for number in range(campaigns)]
        rows.append([
            name,
            f"{sum(is_told(fault, one) for one in found)}/{campaigns}",
            f"{sum(bool(one.established) for one in found)}/{campaigns}",
            f"{sum(one.law is not None for one in found)}/{campaigns}",
            f"{np.median([one.fall.before for one in found]):.1f}",
        ])  # fmt: skip
    return Table(
        "Machines by a base model: what it holds is off, nothing hidden",
        ("what is off", f"told, size within {100.0 * SIZE:.0f} %", "a term named", "a law proposed", "gap"),
        rows,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--campaigns", type=int, default=10)
    print(table(parser.parse_args().campaigns).markdown())


if __name__ == "__main__":
    main()
