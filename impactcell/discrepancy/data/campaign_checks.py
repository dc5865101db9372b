"""Whether mass, velocity and units of a campaign can be: of all its shots, and of each beside the others."""

from collections.abc import Sequence
from dataclasses import replace

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.data.prepared_shots import PreparedShot
from impactcell.discrepancy.data.shot_making import STRATEGIES, prepared_shot
from impactcell.discrepancy.data.shots_unlike import check_signs, unlike_shots
from impactcell.discrepancy.data.unit_checks import check_units
from impactcell.errors import CampaignError
from impactcell.features import without_spikes
from impactcell.quality import UNUSABLE, DataFault, Fault

TELLING = (*UNUSABLE, Fault.COPY, Fault.CLIPPING, Fault.DROPOUTS)
"""Faults of a record that say why a shot is unlike the others, better than a column to check."""


def refuse_rotation(campaign: Campaign) -> None:
    """Refuse what turns: the workflow of parts, and the estimates, are of what slides under its weight.

    Raises
    ------
    CampaignError
        The coordinate is an angle.
    """
    if campaign.coordinate is Coordinate.ROTATION:
        raise CampaignError(
            "what turns is no part that slides under its weight: give a base model (--base BASE.yaml of "
            "`impactcell discrepancy`)"
        )


def check_campaign_units(campaign: Campaign) -> None:
    """Notice a unit that is wrong by a large factor, as `prepare` does, however few the shots.

    Raises
    ------
    CampaignError
        With the columns whose unit to check.
    """
    check_shot_units(campaign, _looked_at(without_outliers(campaign)))


def without_outliers(campaign: Campaign) -> Campaign:
    """Leave lone outliers out, but of a drive: a force that acts has no sample missing."""
    if campaign.excitation is Excitation.DRIVEN:
        return campaign
    return replace(campaign, shots=tuple(without_spikes(shot)[0] for shot in campaign.shots))


def _looked_at(campaign: Campaign) -> list[PreparedShot]:
    """Make shots, or blocks, ready for a look at their ratios alone."""
    strategy = STRATEGIES[campaign.excitation]
    return [prepared_shot(strategy, capture, (1, 1), 0, 0) for capture, _ in strategy.cut(campaign, [])]


def check_shot_units(campaign: Campaign, shots: Sequence[PreparedShot]) -> None:
    """Notice a unit, or a sign, that is wrong in most of a campaign's shots, or blocks.

    Raises
    ------
    CampaignError
        With the columns whose unit to check, or to turn.
    """
    strategy = STRATEGIES[campaign.excitation]
    if campaign.excitation is Excitation.TAP:
        check_signs(shots)
    check_units(strategy.unit_ratios(shot, campaign.gravity_m_s2) for shot in shots)


def without_unlike_shots(
    campaign: Campaign, data_faults: Sequence[DataFault]
) -> tuple[Campaign, dict[int, str]]:
    """Leave out shots of which mass, velocity or position cannot be right beside the others.

    Returns
    -------
    campaign : Campaign
        The same where no shot is left out, as where most would be.
    unlike : dict of int to str
        What to check in each shot that is left out, by its number.
    """
    if campaign.excitation is Excitation.DRIVEN:
        return campaign, {}
    strategy = STRATEGIES[campaign.excitation]
    shots = _looked_at(without_outliers(campaign))
    unlike = unlike_shots(shots, [strategy.unit_ratios(shot, campaign.gravity_m_s2) for shot in shots])
    if not unlike:
        return campaign, {}
    said = {fault.shot: fault.message for fault in reversed(data_faults) if fault.fault in TELLING}
    kept = tuple(shot for shot in campaign.shots if shot.cycle not in unlike)
    return replace(campaign, shots=kept), {number: said.get(number, told) for number, told in unlike.items()}
