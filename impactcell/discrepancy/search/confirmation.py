"""Which effects held-out shots confirm: each has to close a part of the gap."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from impactcell.discrepancy.model import Fit
from impactcell.discrepancy.search.validation import (
    MAX_P_VALUE,
    GapChange,
    GapMeasure,
    Part,
    counted_parts,
)


@dataclass(frozen=True, slots=True, eq=False)
class NestedModels:
    """The model that was accepted, and those inside it.

    Attributes
    ----------
    nominal : Fit
    steps : sequence of (str, Fit)
        Effect, and the model with it and all before it; the last one is the model that was accepted.
    alone : mapping
        Of two effects the model with the second one and without the first, by its name.
    """

    nominal: Fit
    steps: Sequence[tuple[str, Fit]] = ()
    alone: Mapping[str, Fit] = field(default_factory=dict)

    @property
    def largest(self) -> Fit:
        """The model with all effects."""
        return self.steps[-1][1] if self.steps else self.nominal

    @property
    def by_effects(self) -> dict[tuple[str, ...], Fit]:
        """Every model by the effects that it has beside the nominal ones."""
        models: dict[tuple[str, ...], Fit] = {(): self.nominal}
        names: tuple[str, ...] = ()
        for effect, model in self.steps:
            names = (*names, effect)
            models[names] = model
        return models | {(effect,): model for effect, model in self.alone.items()}

    def with_models(self, models: Sequence[Fit]) -> "NestedModels":
        """Return the same with other fits, in the order of `by_effects`."""
        _, *rest = models
        steps = [(effect, fit) for (effect, _), fit in zip(self.steps, rest, strict=False)]
        alone = dict(zip(self.alone, rest[len(steps) :], strict=True))
        return replace(self, nominal=models[0], steps=steps, alone=alone)


def confirmed(measure: GapMeasure, nested: NestedModels, max_p: float = MAX_P_VALUE) -> dict[str, GapChange]:
    """Effects that held-out shots confirm, each with what it closes of what those before it leave.

    Of two effects it may be that neither is seen while the other is missing: then each is asked what it
    closes of what the other leaves; both are confirmed if both do, the second one alone if only it does.

    Parameters
    ----------
    nested : NestedModels
        Fitted to each held-out shot.
    max_p : float
        One-sided error for each of them.
    """
    in_order = _in_order(measure, nested.nominal, nested.steps, max_p)
    if len(in_order) == len(nested.steps) or not nested.alone:
        return in_order
    (first, with_first), (second, with_both) = nested.steps
    with_second = nested.alone[second]
    each = {
        first: _change(measure, with_second, with_both, max_p),
        second: _change(measure, with_first, with_both, max_p),
    }
    real = [effect for effect, change in each.items() if change.is_real(max_p)]
    if len(real) == len(each) and not _rises(measure, nested.nominal, with_both, each.values()):
        return each
    if real == [second] and not in_order:
        return _in_order(measure, nested.nominal, [(second, with_second)], max_p)
    return in_order


def _in_order(
    measure: GapMeasure, nominal: Fit, steps: Sequence[tuple[str, Fit]], max_p: float
) -> dict[str, GapChange]:
    """Confirm effects one by one; the first that is not ends it.

    Where the whole gap, that of the wider part, rises although a part of it falls, an effect still missing
    may be why: those after it have to bring it below where it was.
    """
    changes, waiting = dict[str, GapChange](), dict[str, GapChange]()
    before = agreed = nominal
    for effect, model in steps:
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
