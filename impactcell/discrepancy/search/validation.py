"""Does the gap fall on shots that were never used? Opened once, for every effect by itself."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from impactcell.discrepancy.model import Fit
from impactcell.discrepancy.search.gap import Gap, Part
from impactcell.discrepancy.search.gap_measure import GapChange, GapMeasure


@dataclass(frozen=True, slots=True, eq=False)
class Validation:
    """Gaps before and after, in training and held out.

    Attributes
    ----------
    train_before, train_after : Gap
    held_out : GapChange
        From nominal to final model, judged in the traces, and in the friction factors where their gap is
        beyond their own scatter, or where an effect that was established acts.
    of_effects : dict of str to GapChange
        What each effect that was established does beside those before it.
    expected : tuple of Gap
        Range of the held-out gap where nothing is left.
    is_at_floor : bool
        The final model's gaps are such, in training and held out.
    regions : tuple of (phase, channel, before, after)
        Held-out RMS region by region.
    """

    train_before: Gap
    train_after: Gap
    held_out: GapChange
    of_effects: dict[str, GapChange]
    expected: tuple[Gap, Gap]
    is_at_floor: bool
    regions: tuple[tuple[str, str, float, float], ...]

    def whole(self, gap: Gap) -> float:
        """Gap in the parts that count."""
        return gap.of(self.held_out.parts)

    @property
    def gap_before(self) -> float:
        """Held-out gap of the nominal model."""
        return self.whole(self.held_out.before)

    @property
    def gap_after(self) -> float:
        """Held-out gap of the final model."""
        return self.whole(self.held_out.after)


def counted_parts(
    measure: GapMeasure, models: Sequence[Fit], changes: Iterable[GapChange]
) -> tuple[Part, ...]:
    """Parts in which a gap counts: beyond expectation in some model, or where an effect was established."""
    acting = {part for change in changes for part in change.parts}
    is_wide = any(measure.gap(model).factor > measure.expected(model)[1].factor for model in models)
    return (Part.TRACES, Part.FACTORS) if is_wide or Part.FACTORS in acting else (Part.TRACES,)
