"""Durable store of a cell: cycles, captures, alarms and state in one file."""
