"""Proposals of next experiments as a page tells them: one that tells several ties apart is told once."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from impactcell.discrepancy.data import CellLimits
from impactcell.discrepancy.workflow import DiscrepancyResult

if TYPE_CHECKING:
    from impactcell.discrepancy.search import Proposal


class PlannedExperiment(NamedTuple):
    """What to measure.

    Attributes
    ----------
    apart : str
        What is told from what, in words.
    setting : str
    shots : int
    power : float
        The least over the ties.
    batch : str
        In which the shots are made; empty where there is but one, it has no name, or the setting says it.
    """

    apart: str
    setting: str
    shots: int
    power: float
    batch: str


def planned_experiments(
    result: DiscrepancyResult, apart: Callable[[Sequence[tuple[str, str]]], str]
) -> list[PlannedExperiment]:
    """List what is proposed; `apart` says which effects are told from which."""
    alike: dict[tuple[str, int], list[Proposal]] = {}
    for proposal in result.experiments:
        alike.setdefault((proposal.setting, proposal.shots), []).append(proposal)
    latest = max(result.prepared.shots, key=lambda shot: shot.record)
    batches = result.prepared.batches
    batch = batches[latest.batch] if len(batches) > 1 else ""
    return [
        PlannedExperiment(
            apart([one.effects for one in proposals]),
            setting,
            shots,
            min(one.power for one in proposals),
            "" if setting.startswith("batch ") else batch,
        )
        for (setting, shots), proposals in alike.items()
    ]


def lacks_limits(result: DiscrepancyResult) -> bool:
    """Whether shots are proposed, and nobody has said what the cell can strike."""
    return result.limits == CellLimits() and any(one.shots for one in result.experiments)


def by_effect(pairs: Sequence[tuple[str, str]]) -> list[tuple[str, list[str]]]:
    """Group pairs by the first of each."""
    grouped: dict[str, list[str]] = {}
    for effect, rival in pairs:
        grouped.setdefault(effect, []).append(rival)
    return [*grouped.items()]
