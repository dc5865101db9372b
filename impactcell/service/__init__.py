"""The running service: one task a cell, from the module's cycle to SCADA's nodes."""

from impactcell.service.service import Service, run

__all__ = ["Service", "run"]
