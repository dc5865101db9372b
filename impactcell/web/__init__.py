"""The live page: every cell for people with a browser, beside OPC UA for those with a SCADA client.

It runs in a thread with an event loop of its own. What it shows is handed over as immutable records; what its
viewers do goes back to the service as the same operator commands that OPC UA methods use.
"""

from impactcell.web.interface import CellFacts, CellNews, PageBackend, PageSettings, TourStop
from impactcell.web.server import PageServer

__all__ = ["CellFacts", "CellNews", "PageBackend", "PageServer", "PageSettings", "TourStop"]
