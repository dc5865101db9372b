"""Terms that look like inertia, gravity or drive on the records there are, and places that look like time."""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from impactcell.discrepancy.machine.records.travel import goes_one_way
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.block_sums import RIDGE, Blocks, fit_blocks
from impactcell.discrepancy.machine.regression.nuisance_priors import OFFSET
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.search.held_numbers import FARTHEST_SHARE
from impactcell.discrepancy.machine.terms.base_model import BaseModel, NumberPrior, TermChoice
from impactcell.discrepancy.machine.terms.rival_forms import PLACES
from impactcell.german.findings import enumerated
from impactcell.physics.effect_names import in_words

MAX_ALIKE = 0.95
"""Squared correlation with a part of the machine from which on a term cannot be told from it [1]."""


def machine_parts(base: BaseModel, *, is_driven: bool) -> dict[str, Column]:
    """Columns of what a machine has anyway, by name: what is wrong there would be named by a term like it.

    No gravity is wrong that a base model does not have. What is free is fitted beside every term. Where
    nothing drives and no gravity is held either, the inertia is the unit of every force.
    """
    holds_gravity = base.has_gravity and not math.isinf(base.gravity_torque.std)
    parts: dict[str, Column] = {}
    if (is_driven or holds_gravity) and not math.isinf(base.inertia.std):
        parts["inertia"] = ("inertia", 0.0, 0)
    if holds_gravity:
        parts["gravity"] = ("gravity_torque", 0.0, 0)
    if not math.isinf(base.force_gain.std):
        parts["drive"] = ("force_gain", 0.0, 0)
    if not base.has_free_offset:
        parts["a constant force"] = OFFSET
    return parts


def parts_that_may_be_off(
    blocks: Blocks,
    columns: Sequence[Column],
    parts: Mapping[str, Column],
    known: tuple[Mapping[Column, NumberPrior], frozenset[Column]],
    gravity: float,
) -> dict[str, Column]:
    """Give the parts of a machine by which an error may explain what a model leaves.

    Of a spring that bends as q³ is what moves a light damped part, but a mass that had to be nought for it
    explains nothing: what looks like such a mass is to be looked for. So is what looks like a drive that
    would have to be nought: of a motor at its final speed all torque goes into viscous friction.

    Parameters
    ----------
    blocks : Blocks
    columns : sequence of Column
        Of the model.
    parts : mapping
        As `machine_parts` gives them.
    known : (mapping, frozenset)
        Priors of the nuisances, and strengths that may not be negative.
    gravity : float
        Torque of gravity that the base model states [N m].
    """
    priors, nonnegative = known
    sizes = {"inertia": 1.0, "drive": 1.0, "gravity": abs(gravity)}

    def is_possible(name: str, part: Column) -> bool:
        if not sizes.get(name):
            return True
        others = [column for column in columns if column != part]
        free = {column: prior for column, prior in priors.items() if column != part}
        error = float(fit_blocks(blocks, [*others, part], free, nonnegative).coefficients[-1])
        return abs(error) <= FARTHEST_SHARE * sizes[name]

    return {name: part for name, part in parts.items() if is_possible(name, part)}


def is_over_load(choice: TermChoice) -> bool:
    """Whether a term is friction over what acts on the part beside it."""
    return PLACES.get(choice.identifier) == "friction_over_load"


def like_the_machine(blocks: Blocks, term: ChosenTerm, parts: Iterable[Column], base: BaseModel) -> bool:
    """Whether a term looks like a part of the machine.

    Beside a constant force that is free: from where a position is counted does not matter then. Of one in
    each record the blocks have nothing any more.
    """
    places = blocks.places(term.columns)
    total = blocks.products.sum(axis=0)
    whole = np.diag(total)[places]
    if math.isinf(base.force_offset.std) and not base.force_offset_by_record:
        (offset,) = blocks.places([OFFSET])
        total = total - np.outer(total[:, offset], total[offset]) / total[offset, offset]
    own, left = blocks.places(parts), np.diag(total)[places]
    size = np.outer(np.diag(total)[own], left) + np.finfo(float).tiny
    alike = total[np.ix_(own, places)] ** 2 / size
    return bool(np.all((alike.max(axis=0, initial=0.0) >= MAX_ALIKE) | (left < RIDGE * whole)))


def alike_note(
    candidates: Sequence[TermChoice], kept: Sequence[TermChoice], parts: Mapping[str, Column]
) -> list[str]:
    """Say which terms are not looked for.

    Where no part is held, a term is left out that is as good as constant beside a constant force.
    """
    names = [in_words(choice.name) for choice in candidates if choice not in kept]
    if not names:
        return []
    like = enumerated([*parts] or ["a constant force"], "or")
    return [f"{', '.join(names)}: on these records like {like}, and so not looked for."]


def one_way_note(records: Sequence[UniformRecord]) -> list[str]:
    """Say that a function of position may be one of time, where every record goes one way."""
    if not goes_one_way(records):
        return []
    note = (
        "Every record goes one way: a function of position is one of the time since its beginning as well, "
        "and these records hardly tell them apart."
    )
    return [note]
