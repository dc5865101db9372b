"""Which effects held-out shots confirm: each has to close a part of the gap."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import takewhile

from impactcell.discrepancy.model import Fit
from impactcell.discrepancy.search.gap import Part
from impactcell.discrepancy.search.gap_measure import MAX_P_VALUE, GapChange, GapMeasure
from impactcell.discrepancy.search.validation import counted_parts

VISIBLE_BESIDE = 1.2
"""Gap of the traces [noise floors] that others must leave without an effect for it to have a name beside
them. The model error of half a floor that any machine has makes 1.1, and a wave or a patch takes that too."""


@dataclass(frozen=True, slots=True, eq=False)
class NestedModels:
    """The model that was accepted, and those inside it.

    Attributes
    ----------
    models : mapping
        Fits by the effects that they have beside the nominal ones.
    added : tuple of str
        All these effects, in the order in which they were added.
    """

    models: Mapping[frozenset[str], Fit]
    added: tuple[str, ...] = ()

    @property
    def nominal(self) -> Fit:
        """The model without any of the effects."""
        return self.models[frozenset()]

    @property
    def largest(self) -> Fit:
        """The model with all effects."""
        return self.models[frozenset(self.added)]

    @property
    def steps(self) -> list[tuple[str, Fit]]:
        """Each effect, and the model with it and all before it; as far as these are there."""
        chain = [(effect, frozenset(self.added[: place + 1])) for place, effect in enumerate(self.added)]
        there = takewhile(lambda step: step[1] in self.models, chain)
        return [(effect, self.models[names]) for effect, names in there]

    def without(self, effect: str) -> Fit | None:
        """Return the model with all other effects."""
        return self.models.get(frozenset(self.added) - {effect})


def confirmed(
    measure: GapMeasure,
    nested: NestedModels,
    max_p: float = MAX_P_VALUE,
    trained: Callable[[frozenset[str]], float] = lambda _: 0.0,
) -> dict[str, GapChange]:
    """Effects that held-out shots confirm, each with what it closes of what those before it leave.

    Of several effects it may be that one is not seen while another is missing: then each is asked what it
    closes of what all others leave. They are confirmed if all do; else those that do are asked without the
    rest, and are confirmed if more of them are than in order, or as many that leave less. Of those that are,
    one without which the others leave next to nothing goes, and the rest are asked again.

    Parameters
    ----------
    nested : NestedModels
        Fitted to each held-out shot.
    max_p : float
        One-sided error for each of them.
    trained : callable
        Gap of the traces that a model with some effects leaves of the training shots: an effect that acts in
        a few shots may be in none of those held out.
    """
    changes = _confirmed(measure, nested, max_p)
    if len(nested.added) < 2:
        return changes
    while (hidden := _least_visible(measure, replace(nested, added=tuple(changes)), trained)) is not None:
        seen = tuple(effect for effect in changes if effect != hidden)
        changes = _confirmed(measure, replace(nested, added=seen), max_p)
    return changes


def _least_visible(
    measure: GapMeasure, nested: NestedModels, trained: Callable[[frozenset[str]], float]
) -> str | None:
    """Effect without which the others leave least, if that is next to nothing; else None."""
    whole, least = measure.gap(nested.largest), dict[str, float]()
    for effect in nested.added:
        model = nested.without(effect)
        if model is None or whole.is_narrower(gap := measure.gap(model)):
            continue
        left = max(gap.trace, trained(frozenset(nested.added) - {effect}))
        if left < VISIBLE_BESIDE:
            least[effect] = left
    return min(least, key=least.__getitem__, default=None)


def _confirmed(measure: GapMeasure, nested: NestedModels, max_p: float) -> dict[str, GapChange]:
    """Confirm effects in order, or else each beside all others."""
    in_order = _in_order(measure, nested, max_p)
    if len(in_order) == len(nested.added):
        return in_order
    each = {
        effect: _change(measure, model, nested.largest, max_p)
        for effect in nested.added
        if (model := nested.without(effect)) is not None
    }
    real = tuple(effect for effect, change in each.items() if change.is_real(max_p))
    if len(real) == len(nested.added):
        return in_order if _rises(measure, nested.nominal, nested.largest, each.values()) else each
    if frozenset(real) not in nested.models:
        return in_order
    fewer = _confirmed(measure, replace(nested, added=real), max_p)
    return max(in_order, fewer, key=lambda changes: (len(changes), -_left(measure, nested, changes)))


def _left(measure: GapMeasure, nested: NestedModels, changes: Mapping[str, GapChange]) -> float:
    """Gap that the model with these effects leaves."""
    return measure.gap(nested.models[frozenset(changes)]).of(Part)


def _in_order(measure: GapMeasure, nested: NestedModels, max_p: float) -> dict[str, GapChange]:
    """Confirm effects one by one; the first that is not ends it.

    Where the whole gap, that of the wider part, rises although a part of it falls, an effect still missing
    may be why: those after it have to bring it below where it was.
    """
    changes, waiting = dict[str, GapChange](), dict[str, GapChange]()
    before = agreed = nested.nominal
    for effect, model in nested.steps:
        waiting[effect] = _change(measure, before, model, max_p)
        if not waiting[effect].is_real(max_p):
            break
        if not _rises(measure, agreed, model, waiting.values()):
            changes |= waiting
            waiting, agreed = {}, model
        before = model
    return changes


def _change(measure: GapMeasure, before: Fit, after: Fit, max_p: float) -> GapChange:
    """Change of the gap in the part that falls most or, at half the error, in one that is surer to fall."""
    change = measure.change(before, after)
    if change.is_real(max_p):
        return change
    others = [measure.change(before, after, [part]) for part in Part if part not in change.parts]
    return next((other for other in others if other.is_real(0.5 * max_p)), change)


def _rises(measure: GapMeasure, before: Fit, after: Fit, changes: Iterable[GapChange]) -> bool:
    parts = counted_parts(measure, (before, after), changes)
    return measure.gap(after).of(parts) > measure.gap(before).of(parts)
