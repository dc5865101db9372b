"""Campaign directories: recorded shots on disk, read and written in one format."""

from impactcell.campaign.contents import Campaign, Excitation, Sensor
from impactcell.campaign.pretrigger import from_contact
from impactcell.campaign.reading import read
from impactcell.campaign.writing import write

__all__ = ["Campaign", "Excitation", "Sensor", "from_contact", "read", "write"]
