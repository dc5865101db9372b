"""The conditions of a cell, with the settings they start from."""

from generators.markdown import code, table
from impactcell.alarms import RULES


def rules() -> str:
    """Write a row a condition."""
    rows = []
    for name, rule in RULES.items():
        chosen = rule.settings
        is_set = "" if rule.evaluate is None else "off-delay" if rule.is_occurrence else "both"
        rows.append((code(name), str(chosen.severity), str(chosen.on_delay), str(chosen.off_delay), is_set))
    columns = (
        "condition",
        "severity",
        "on-delay, cycles",
        "off-delay, cycles",
        "delays set by the cell file",
    )
    return table(columns, rows)
