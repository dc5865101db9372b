"""What another model makes of the taps that a cell's own journal holds, beside the model in service."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Final

from impactcell.cell import fill_defaults
from impactcell.cli.paths import note_damage, open_journal
from impactcell.features import Features, extract
from impactcell.prediction import Model, estimate_from_features
from impactcell.records import Quality
from impactcell.service.factory import cell_design
from impactcell.settings import CellConfig

TAPS: Final = 30
"""Last taps that are looked at."""
WORSE: Final = 1.5
"""By which factor what a model leaves of them has to grow for it to speak against the model. Own choice: taps
of one kind differ by less, another plant's model by far more."""
USABLE: Final = 0.5
"""Share of the estimates that have to stay usable."""


@dataclass(frozen=True, slots=True)
class OwnTaps:
    """What two models make of the same taps: median residual, 1 = noise, and taps with a usable mu_s."""

    taps: int
    gap_before: float
    gap_after: float
    usable_before: int
    usable_after: int

    @property
    def speaks_against(self) -> bool:
        """Whether the second model does clearly worse."""
        if self.usable_after < USABLE * self.usable_before:
            return True
        if math.isnan(self.gap_after):
            return not math.isnan(self.gap_before)
        return self.gap_after > WORSE * max(self.gap_before, 1.0)

    @property
    def sentence(self) -> str:
        """Say it."""
        after = f"{_follows(self.gap_after)}, {self.usable_after} estimates are usable"
        before = f"{_follows(self.gap_before)}, {self.usable_before} are"
        return f"of the cell's last {self.taps} taps it {after}; the model before {before}"

    @property
    def content(self) -> dict[str, int | float | None]:
        """Give the same as JSON has it."""
        return {name: None if math.isnan(value) else value for name, value in asdict(self).items()}


def _follows(gap: float) -> str:
    if math.isnan(gap):
        return "can follow none"
    times = f"{gap:.3g}"
    return (
        "leaves no more than the sensors' noise"
        if times == "1"
        else f"leaves {times} times the sensors' noise"
    )


def compare_on_own_taps(config: CellConfig, after: Model) -> OwnTaps | None:
    """Look at a cell's last taps with its model and another one; None where its journal holds none.

    Raises
    ------
    JournalError
        The journal cannot be read, or is another cell's.
    """
    section = config.settings.journal
    if section is None or not section.file.is_file():
        return None
    defaults = cell_design(config).defaults
    with open_journal(section.file, config.name) as journal:
        captures = [
            fill_defaults(defaults, one) for one in journal.captures(damaged=note_damage, newest=TAPS)
        ]
    if not captures:
        return None
    features = [extract(capture) for capture in captures]
    (gap_before, usable_before), (gap_after, usable_after) = (
        _estimated(features, model) for model in (config.model, after)
    )
    return OwnTaps(len(captures), gap_before, gap_after, usable_before, usable_after)


def _estimated(features: Sequence[Features], model: Model) -> tuple[float, int]:
    """Median residual, and number of taps whose mu_s is not bad."""
    friction = [estimate_from_features(one, model) for one in features]
    gaps = [one.gap for one in friction if not math.isnan(one.gap)]
    usable = sum(one.mu_s.quality is not Quality.BAD for one in friction)
    return median(gaps) if gaps else math.nan, usable
