"""ModuleConnection: the module that measures does not answer."""

from impactcell.alarms.rule import AlarmRule, ConditionClass, Message, RuleResult, RuleSettings
from impactcell.german.link_faults import german_link_fault

NAME = "ModuleConnection"
"""Published name."""


def result(reason: str, *, connected: bool, answered: bool = False) -> RuleResult:
    """Say what became of the connection; `reason` in words where there is none.

    `answered`: something answers in the module's place, so that neither power nor cable is why.
    """
    if answered:
        return RuleResult(NAME, not connected, _another(reason))
    message = Message(
        f"The module does not answer, no cycles come in: {reason}. "
        "Check its power, its network cable and its address.",
        f"Das Modul antwortet nicht, es kommen keine Zyklen an: {german_link_fault(reason)}. "
        "Stromversorgung, Netzwerkkabel und Adresse prüfen.",
    )
    return RuleResult(NAME, not connected, message)


def _another(reason: str) -> Message:
    return Message(
        f"Something answers at the module's address, but not as this module does, and no cycles come in: "
        f"{reason}. Check address, port and register map of the cell.",
        "Unter der Adresse des Moduls antwortet etwas, aber nicht so wie dieses Modul, und es kommen keine "
        f"Zyklen an: {german_link_fault(reason)}. Adresse, Port und Registerkarte der Zelle prüfen.",
    )


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
