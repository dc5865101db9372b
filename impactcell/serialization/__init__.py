"""Frozen dataclasses written down and read back to the same bits."""
