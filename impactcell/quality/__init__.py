"""What is wrong with recorded data: outliers, clipping, dropouts, drift, a late channel, no slide."""

from impactcell.quality.campaigns import UNUSABLE, inspect_campaign, notes_of, refuse_unusable
from impactcell.quality.data_fault import DataFault, Fault

__all__ = ["UNUSABLE", "DataFault", "Fault", "inspect_campaign", "notes_of", "refuse_unusable"]
