"""What is wrong with recorded data: outliers, clipping, dropouts, drift, a late channel, no slide, a copy."""

from impactcell.quality.campaigns import UNUSABLE, inspect_campaign, notes_of, refuse_unusable
from impactcell.quality.channel_faults import ends_of_range, gaps_in_time
from impactcell.quality.copies import copies
from impactcell.quality.data_fault import DataFault, Fault

__all__ = [
    "UNUSABLE",
    "DataFault",
    "Fault",
    "copies",
    "ends_of_range",
    "gaps_in_time",
    "inspect_campaign",
    "notes_of",
    "refuse_unusable",
]
