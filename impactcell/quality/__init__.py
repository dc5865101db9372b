"""What is wrong with recorded data: outliers, clipping, dropouts, drift, a late channel, no slide."""

from impactcell.quality.campaigns import inspect_campaign, notes_of, refuse_unusable
from impactcell.quality.data_fault import DataFault, Fault

__all__ = ["DataFault", "Fault", "inspect_campaign", "notes_of", "refuse_unusable"]
