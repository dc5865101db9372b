"""The EventIds by which clients act on alarms.

They are derived from what is stored with the alarm and so need not be kept: the first half tells the cell,
the condition and the activation, the second what was told. A client may act on any event of the present
activation, days later and over restarts; one of an earlier activation no longer stands for the alarm.
"""

import hashlib

from impactcell.records import Alarm


def activation_id(cell: str, alarm: Alarm) -> bytes:
    """First half of the EventIds of all events of one activation."""
    return _digest(cell, alarm.name, alarm.activation)


def event_id(cell: str, alarm: Alarm) -> bytes:
    """EventId of the event that tells a state of an alarm."""
    return activation_id(cell, alarm) + _digest(*_told(alarm))


def _told(alarm: Alarm) -> tuple[object, ...]:
    """Give what of an alarm is worth an event: state, severity, comment, figures, but not how it is worded.

    Figures of an active alarm are renewed only by an agreed step (`alarms.rule.RuleSettings.told_step`).
    """
    return (
        *(alarm.enabled, alarm.active, alarm.acknowledged, alarm.confirmed, alarm.shelving.value),
        *(alarm.shelved_until_ns, alarm.suppressed, alarm.out_of_service, alarm.severity),
        *(alarm.cycle, alarm.time_ns, alarm.comment, alarm.user, alarm.evidence),
    )


def _digest(*parts: object) -> bytes:
    return hashlib.sha256("\0".join(map(str, parts)).encode()).digest()[:8]
