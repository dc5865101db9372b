"""Terms that look like inertia, gravity or drive on the records there are, and places that look like time."""

from collections.abc import Sequence

import numpy as np

from impactcell.discrepancy.machine.base_model import TermChoice
from impactcell.discrepancy.machine.regression import Blocks
from impactcell.discrepancy.machine.trials import ChosenTerm
from impactcell.discrepancy.machine.uniform_records import UniformRecord
from impactcell.discrepancy.machine.weak_form import Column
from impactcell.physics.effect_names import in_words

MACHINE: tuple[Column, ...] = tuple(
    (name, 0.0, 0) for name in ("inertia", "gravity_torque", "force_gain", "force_offset")
)
"""Columns of the machine itself."""
MAX_ALIKE = 0.95
"""Squared correlation with inertia, gravity or drive from which on a term cannot be told from it [1]."""

ONE_WAY = 0.95
"""Share of a record's path that lies between its ends where it goes one way [1]."""


def like_the_machine(blocks: Blocks, term: ChosenTerm) -> bool:
    """Whether a term looks like inertia, gravity or drive: what is wrong with those would be named by it."""
    own = blocks.places(MACHINE)
    places = blocks.places(term.columns)
    total = blocks.products.sum(axis=0)
    tiny = np.finfo(float).tiny
    size = np.outer(np.diag(total)[own], np.diag(total)[places]) + tiny
    alike = total[np.ix_(own, places)] ** 2 / size
    return bool(np.all(alike.max(axis=0) >= MAX_ALIKE))


def alike_note(candidates: Sequence[TermChoice], kept: Sequence[TermChoice]) -> list[str]:
    """Say which terms are not looked for."""
    names = [in_words(choice.name) for choice in candidates if choice not in kept]
    if not names:
        return []
    return [f"{', '.join(names)}: on these records like inertia, gravity or drive, and so not looked for."]


def one_way_note(records: Sequence[UniformRecord]) -> list[str]:
    """Say that a function of position may be one of time, where every record goes one way."""
    for record in records:
        width = max(len(record.position) // 200, 1)  # between quantised positions noise goes to and fro
        coarse = record.position[::width]
        if abs(coarse[-1] - coarse[0]) < ONE_WAY * float(np.abs(np.diff(coarse)).sum()):
            return []
    note = (
        "Every record goes one way: a function of position is one of the time since its beginning as well, "
        "and these records hardly tell them apart."
    )
    return [note]
