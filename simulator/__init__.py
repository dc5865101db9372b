"""A cell that the service has never seen: its own plant behind a real Modbus TCP server."""
