"""How late the force was recorded, where a base model does not say: what a delay would explain."""

from collections.abc import Sequence
from dataclasses import replace

from impactcell.discrepancy.machine.regression import fit_blocks
from impactcell.discrepancy.machine.selection import MIN_GAIN_Z, MIN_SHARE, SelectionStep
from impactcell.discrepancy.machine.ties import MIN_TIED_SHARE, TIE_Z
from impactcell.discrepancy.machine.trials import TermSearch, mean_over_error
from impactcell.discrepancy.machine.weak_form import Column

DELAY: Column = ("delay_s", 0.0, 0)
"""Column of how late the force was recorded: the force's derivative."""
MOST = 0.5
"""Share of what remains from which on a delay is what the headline tells [1]."""
AS_LATE = "a force recorded late or early by less than a sample would explain as much as the best term"
"""Why the best term is not taken where the delay is not known so well."""


def explained_by_delay(search: TermSearch, columns: Sequence[Column]) -> tuple[float, float] | None:
    """How late the force would have been recorded [s], and the share of what remains that this explains.

    None where it does not hold from block to block, or explains little.
    """
    before = search.losses(columns)
    gains = before - search.losses([*columns, DELAY])
    excess = float(before.sum() - search.blocks.noise.sum())
    if not (mean_over_error(gains) >= MIN_GAIN_Z and gains.sum() >= MIN_SHARE * excess > 0.0):
        return None
    return _fitted_delay(search, columns), min(float(gains.sum()) / excess, 1.0)


def told_from_delay(
    search: TermSearch, columns: Sequence[Column], steps: list[SelectionStep], sample_s: float
) -> list[SelectionStep]:
    """Refuse the first step of a selection where a delay of less than a sample would explain about as much.

    That a force was recorded so late or early nobody can exclude who has not stated it.
    """
    if not steps or (best := steps[0].accepted) is None:
        return steps
    gains = search.losses(columns) - search.losses([*columns, DELAY])
    as_well = float(gains.sum()) >= MIN_TIED_SHARE * best.gain and mean_over_error(best.gains - gains) < TIE_Z
    if not as_well or mean_over_error(gains) < MIN_GAIN_Z:
        return steps
    if abs(_fitted_delay(search, columns)) > sample_s:
        return steps
    return [replace(steps[0], accepted=None, tied_with=(), reason=AS_LATE)]


def _fitted_delay(search: TermSearch, columns: Sequence[Column]) -> float:
    """Delay of least squares beside a model's columns [s]."""
    fit = fit_blocks(search.blocks, [*columns, DELAY], search.priors, search.nonnegative)
    return float(fit.coefficients[-1])


def delay_note(explained: tuple[float, float] | None) -> list[str]:
    """Say what a delay that the base model does not have would explain."""
    if explained is None:
        return []
    note = (
        f"A{_words(explained)[1:]} of what remains: delay_s among the nuisances of the base model finds the "
        "delay with everything else."
    )
    return [note]


def blamed_on_delay(steps: list[SelectionStep], explained: tuple[float, float] | None) -> list[SelectionStep]:
    """Give as the reason why no term was taken a delay that would explain most of what remains."""
    if explained is None or explained[1] < MOST or not steps or steps[0].accepted is not None:
        return steps
    return [replace(steps[0], reason=f"{_words(explained)} of it"), *steps[1:]]


def _words(explained: tuple[float, float]) -> str:
    delay_s, share = explained
    when = "late" if delay_s > 0.0 else "early"
    off_ms = float(f"{1e3 * abs(delay_s):.2g}")
    return f"a force recorded {off_ms:g} ms {when} would explain {100.0 * share:.0f} %"
