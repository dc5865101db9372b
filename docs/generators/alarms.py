"""The conditions of a cell, with the settings they start from."""

from generators.markdown import code, table
from impactcell.alarms import RULES


def rules() -> str:
    """Write a row a condition."""
    rows = []
    for name, rule in RULES.items():
        chosen = rule.settings
        rows.append((code(name), str(chosen.severity), str(chosen.on_delay), str(chosen.off_delay)))
    return table(("condition", "severity", "on-delay, cycles", "off-delay, cycles"), rows)
