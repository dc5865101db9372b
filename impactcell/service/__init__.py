"""The running service: one task a cell, from the module's cycle to SCADA's nodes."""
