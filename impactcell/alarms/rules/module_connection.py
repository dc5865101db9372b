"""ModuleConnection: the module that measures does not answer."""

from impactcell.alarms.rule import AlarmRule, ConditionClass, Message, RuleResult, RuleSettings
from impactcell.german.link_faults import german_link_fault

NAME = "ModuleConnection"
"""Published name."""


def result(reason: str, *, connected: bool) -> RuleResult:
    """Say what became of the connection; `reason` in words where there is none."""
    message = Message(
        f"The module does not answer, no cycles come in: {reason}. "
        "Check its power, its network cable and its address.",
        f"Das Modul antwortet nicht, es kommen keine Zyklen an: {german_link_fault(reason)}. "
        "Stromversorgung, Netzwerkkabel und Adresse prüfen.",
    )
    return RuleResult(NAME, not connected, message)


RULE = AlarmRule(
    name=NAME,
    node_number=5011,
    type_number=1006,
    title=Message("Module connection", "Verbindung zum Modul"),
    description=Message("The module does not answer.", "Das Modul antwortet nicht."),
    settings=RuleSettings(severity=800, told_step=0.0),
    condition_class=ConditionClass.SYSTEM,
    input_node="Module/Connected",
    logged_by_cause=True,
)
"""The rule."""
