"""The conditions of a cell, with the settings they start from."""

from generators.markdown import code, table
from impactcell.alarms import RULES


def rules() -> str:
    """Write a row a condition."""
    rows = []
    for name, rule in RULES.items():
        chosen = rule.settings
        is_set = "yes" if rule.evaluate is not None else ""
        on_delay = "none" if rule.is_occurrence else str(chosen.on_delay)
        rows.append((code(name), str(chosen.severity), on_delay, str(chosen.off_delay), is_set))
    columns = (
        "condition",
        "severity",
        "on-delay, cycles",
        "off-delay, cycles",
        "delays set by the cell file",
    )
    return table(columns, rows)
