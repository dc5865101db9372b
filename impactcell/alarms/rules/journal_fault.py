"""JournalFault: what the cell has measured cannot be stored."""

from impactcell.alarms.rule import AlarmRule, ConditionClass, Message, RuleResult, RuleSettings
from impactcell.german.journal_faults import german_journal_fault

NAME = "JournalFault"
"""Published name."""


def result(reason: str) -> RuleResult:
    """Say why the journal cannot be written; an empty reason says that it can."""
    message = Message(
        f"Cycles cannot be stored: {reason}. The cell runs on, but what is not stored is lost with a "
        "restart. Make room or repair the disk.",
        f"Zyklen können nicht gespeichert werden: {german_journal_fault(reason)}. Die Zelle läuft weiter, "
        "doch was nicht gespeichert ist, geht bei einem Neustart verloren. Platz schaffen oder Datenträger "
        "instand setzen.",
    )
    return RuleResult(NAME, bool(reason), message)


RULE = AlarmRule(
    name=NAME,
    node_number=5014,
    type_number=1009,
    title=Message("Journal fault", "Journal gestört"),
    description=Message("Cycles cannot be stored.", "Zyklen können nicht gespeichert werden."),
    settings=RuleSettings(severity=900, told_step=0.0),
    condition_class=ConditionClass.SYSTEM,
    logged_by_cause=True,
)
"""The rule."""
