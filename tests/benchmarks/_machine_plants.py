"""Slides that stick and turn and an axis that rests between its moves: nothing hidden, and one term hidden.

`python -m tests.benchmarks._machine_plants` investigates each with a base model that has everything but what
is hidden, and prints the verdict, the held-out gap and how far off the strengths are.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from impactcell.campaign import Campaign
from impactcell.discrepancy.machine import (
    BaseModel,
    MachineFinding,
    NumberPrior,
    TermChoice,
    investigate_machine,
)
from tests.benchmarks.table import Table
from tests.discrepancy.stick_slip import COULOMB_N, SLIDE, VISCOUS_N_S_PER_M, levels, sines, slides
from tests.discrepancy.test_moves_between_places import AXIS, axis

if TYPE_CHECKING:
    from impactcell.records import Samples

QUIET = (0.02, 1e-5)
DELAY = replace(SLIDE, delay_s=NumberPrior(0.0, 5e-3))
SPRING_N_PER_M = 20.0
KNOWN = {"coulomb_friction": COULOMB_N, "viscous_friction": VISCOUS_N_S_PER_M}
"""Strengths of every plant beside what is hidden in it."""


@dataclass(frozen=True)
class Plant:
    """Records, a base model, and the strengths that a model of everything has."""

    name: str
    hidden: str
    records: Callable[[], Campaign]
    base: BaseModel
    strengths: dict[str, float]


def driven(
    noise: tuple[float, float] = QUIET, amplitude_n: float = 4.0, **how: float
) -> Callable[..., Campaign]:
    """Slides under sines, with a law of friction beside."""
    return lambda law=None: slides(lambda rng: sines(amplitude_n, rng), noise, law, **how)  # type: ignore[arg-type]


def held(noise: tuple[float, float]) -> Campaign:
    """Slides under levels of 0.4 s."""
    return slides(lambda rng: levels(8.0, 0.4, rng), noise)


def plants() -> Iterator[Plant]:
    """Every one of them."""
    nothing: list[tuple[str, Callable[[], Campaign], BaseModel]] = [
        ("slide, 250 Hz", driven(), SLIDE),
        ("slide, ten times the noise of the position", driven((0.02, 1e-4)), SLIDE),
        ("slide, a hundred times, and ten of the force", driven((0.2, 1e-3)), SLIDE),
        ("slide, 50 Hz", driven(rate_hz=50.0, duration_s=40.0), SLIDE),
        ("slide, 1 kHz", driven(rate_hz=1000.0, duration_s=8.0), SLIDE),
        ("slide, three records", driven(count=3, duration_s=40.0), SLIDE),
        ("slide that rests half of the time", driven(amplitude_n=1.0), SLIDE),
        ("slide, levels of a command", lambda: held((0.0, 1e-5)), SLIDE),
        ("slide, levels as measured", lambda: held((0.05, 1e-5)), SLIDE),
        ("the same, delay free", lambda: held((0.05, 1e-5)), DELAY),
        ("axis that rests between its moves", axis, AXIS),
    ]
    for name, records, base in nothing:
        yield Plant(name, "", records, base, KNOWN)
    for hidden in KNOWN:
        others = tuple(choice for choice in SLIDE.terms if choice.name != hidden)
        yield Plant("slide, 250 Hz", hidden, driven(), replace(SLIDE, terms=others), KNOWN)
    laws: list[tuple[str, float, Callable[[Samples, Samples], Samples]]] = [
        ("quadratic_drag", 6.0, lambda _, v: 6.0 * v**2),
        ("stribeck_friction", 0.3, lambda _, v: 0.3 * np.exp(-((v / 0.1) ** 2))),
        ("stribeck_friction", 1.0, lambda _, v: np.exp(-((v / 0.1) ** 2))),
        ("position_dependent_friction", 1.5, lambda q, _: 1.5 * q),
    ]
    for hidden, strength, law in laws:
        friction = lambda q, v, law=law: COULOMB_N + law(q, v)  # noqa: E731
        records = driven()
        yield Plant(
            "slide, 250 Hz", hidden, lambda records=records, friction=friction: records(friction),  # type: ignore[misc]
            SLIDE, KNOWN | {hidden: strength},
        )  # fmt: skip
    spring = KNOWN | {"restoring_force": SPRING_N_PER_M}
    sprung = driven(spring_n_per_m=SPRING_N_PER_M)
    yield Plant("slide, 250 Hz", "restoring_force", sprung, SLIDE, spring)
    base = replace(AXIS, terms=(TermChoice("coulomb_friction"),))
    yield Plant("axis that rests between its moves", "viscous_friction", axis, base, KNOWN)
    moves: list[tuple[str, float, Callable[[Samples, Samples], Samples]]] = [
        ("periodic_force", -0.2, lambda q, _: 0.2 * np.sin(2.0 * np.pi * q / 0.06)),
        ("directional_viscous_friction", 1.0, lambda _, v: np.abs(v)),
        ("position_dependent_friction", 0.8, lambda q, v: 0.8 * q * np.sign(v)),
        ("restoring_force", SPRING_N_PER_M, lambda q, _: SPRING_N_PER_M * q),
    ]
    for hidden, strength, law in moves:
        yield Plant(
            "axis that rests between its moves",
            hidden,
            lambda law=law: axis(law),
            AXIS,
            KNOWN | {hidden: strength},  # type: ignore[misc]
        )


def farthest(finding: MachineFinding, strengths: dict[str, float]) -> str:
    """Largest relative error of the strengths that the final model has."""
    errors = [
        abs(finding.final.value(term.columns[0]) / strengths[term.choice.name] - 1.0)
        for term in finding.final.terms
        if term.choice.name in strengths
    ]
    return f"{100.0 * max(errors):.2g} %" if errors else ""


def main() -> None:
    """Investigate each and print the table."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    lines = []
    for plant in plants():
        finding = investigate_machine(plant.records(), plant.base)
        right = (plant.hidden,) if plant.hidden else ()
        names = " or ".join(
            [*finding.established, *(name for tied in finding.tied_with.values() for name in tied)]
        )
        verdict = f"{finding.verdict}{f', {names}' if names else ''}{' and a law' if finding.law else ''}"
        is_right = finding.established == right and (bool(right) or finding.verdict == "no_gap")
        gap = f"{finding.fall.before:.3g}" + (f" to {finding.fall.after:.2g}" if finding.established else "")
        lines.append(
            [plant.name, plant.hidden or "nothing", verdict if is_right else f"**{verdict}**", gap,
             farthest(finding, plant.strengths)]
        )  # fmt: skip
        print(" | ".join(lines[-1]), flush=True)
    columns = ("plant", "hidden", "verdict", "held-out gap", "farthest strength")
    print(Table("Slides and an axis", columns, lines).markdown())


if __name__ == "__main__":
    main()
