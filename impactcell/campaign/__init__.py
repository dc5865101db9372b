"""Campaign directories: recorded shots on disk, read and written in one format."""

from impactcell.campaign.contents import COLUMNS, Campaign, Coordinate, Excitation, Sensor
from impactcell.campaign.faults import LARGEST, naming
from impactcell.campaign.pretrigger import from_contact
from impactcell.campaign.reading import read
from impactcell.campaign.writing import write

__all__ = [
    "COLUMNS",
    "LARGEST",
    "Campaign",
    "Coordinate",
    "Excitation",
    "Sensor",
    "from_contact",
    "naming",
    "read",
    "write",
]
