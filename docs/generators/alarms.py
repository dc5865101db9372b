"""The conditions of a cell, with the settings they start from."""

from generators.markdown import code, table
from impactcell.alarms import AlarmSettings
from impactcell.records import AlarmName


def rules() -> str:
    """Write a row a condition."""
    settings = AlarmSettings()
    rows = []
    for name in AlarmName:
        rule = settings.rule(name)
        rows.append((code(name.value), str(rule.severity), str(rule.on_delay), str(rule.off_delay)))
    return table(("condition", "severity", "on-delay, cycles", "off-delay, cycles"), rows)
