"""What an alarm rule is: everything about one condition of a cell, declared in one file of `alarms.rules`."""

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass

from impactcell.records import (
    BatchState,
    Evidence,
    FrictionEstimate,
    Quality,
    Signature,
    TapPredictions,
    WearState,
)
from impactcell.records.uncertainty import plus_minus


class ConditionClass(enum.Enum):
    """Classes of conditions of OPC UA Part 9, 5.9, by their browse names."""

    PROCESS = "ProcessConditionClass"
    MAINTENANCE = "MaintenanceConditionClass"
    SYSTEM = "SystemConditionClass"


@dataclass(frozen=True, slots=True)
class Message:
    """A sentence for a shift worker: what, since when, how sure, what to do."""

    english: str
    german: str

    def text(self, language: str) -> str:
        """Return it in the language of a locale id, as "de" or "de-AT"; English where there is no other."""
        return self.german if language.partition("-")[0].lower() == "de" else self.english


NO_MESSAGE = Message("", "")
"""Of a rule that does not hold."""
NO_EVIDENCE = Evidence()
"""Of a rule without figures."""


def german(value: float, form: str, std: float | None = None) -> str:
    """Write a number as German has it, with a comma, and with ± where its standard deviation is given."""
    return (format(value, form) if std is None else plus_minus(value, std, form)).replace(".", ",")


NEARLY_SURE, MOST_SURE = 0.99, 0.999
"""Probabilities from which a message tells tenths of a per cent, and from which it says no more than "over":
no model is surer of itself than that."""


def percent_sure(probability: float) -> tuple[str, str]:
    """Write a probability in per cent, English and German; never as 100."""
    if probability > MOST_SURE:
        return "over 99.9", "über 99,9"
    form = ".1f" if probability > NEARLY_SURE else ".0f"
    return format(100.0 * probability, form), german(100.0 * probability, form)


@dataclass(frozen=True, slots=True)
class RuleSettings:
    """What a cell may choose about one condition.

    Attributes
    ----------
    severity : int
        1-1000, as in OPC UA.
    on_delay, off_delay : int
        Cycles for which the rule must hold, and not hold, before the alarm activates and clears.
    realarm : int
        Cycles after which an alarm that is still active calls again; 0 for never.
    enabled : bool
        Whether the condition starts enabled.
    activate_above, clear_below : float
        Hysteresis of the rule's statistic; nan for a rule that has a threshold of its own.
    told_step : float
        While the alarm is active, evidence is told anew once its size has changed by so many of its standard
        deviations, and not where it has no size; 0 tells every change, of its message too, as of a rule whose
        every result is an occurrence of its own.
    """

    severity: int = 500
    on_delay: int = 0
    off_delay: int = 0
    realarm: int = 0
    enabled: bool = True
    activate_above: float = math.nan
    clear_below: float = math.nan
    told_step: float = 1.0


@dataclass(frozen=True, slots=True)
class RuleResult:
    """What a rule says of one condition now.

    Attributes
    ----------
    holds : bool or None
        None where it cannot tell, and all stays as it is.
    hold_back : int
        Cycles for which it waits whether a rule that may explain it says so (`AlarmRule.explained_by`).
    is_explained : bool
        Another rule has: what was held back is given up.
    """

    name: str
    holds: bool | None
    message: Message = NO_MESSAGE
    evidence: Evidence = NO_EVIDENCE
    hold_back: int = 0
    is_explained: bool = False


@dataclass(frozen=True, slots=True)
class CycleInputs:
    """What rules may look at after a cycle; what was not computed is None.

    Attributes
    ----------
    shift : Evidence or None
        Of a batch shift, at the one cycle at which it is detected.
    innovation : float
        Of the tracker: mu_s minus what was predicted, in standard deviations; nan where it was not used.
    deviation : Evidence or None
        Of the signature, where the cycle deviates; `judged` says whether that could be told.
    pushed_m : float
        Way of the part from where it lay until contact was last lost, m; nan where it is not known.
    gap : Evidence
        Of the model's residual; `gap_exceeds` None while the usual one is being learned.
    predictions : TapPredictions or None
        What positioning taps say of the model.
    probability_at_horizon, horizon : float
        That the level will be above the wear limit so many cycles from now; nan where there is no limit.
    false_alarm_cycles, period_s : float
        Designed mean number of cycles between false alarms, mean time between cycles; nan: not known.
    """

    cycle: int
    wear: WearState
    batch: BatchState | None = None
    friction: FrictionEstimate | None = None
    signature: Signature | None = None
    shift: Evidence | None = None
    innovation: float = math.nan
    deviation: Evidence | None = None
    judged: bool = False
    pushed_m: float = math.nan
    gap: Evidence = NO_EVIDENCE
    gap_exceeds: bool | None = None
    predictions: TapPredictions | None = None
    probability_at_horizon: float = math.nan
    horizon: float = math.nan
    false_alarm_cycles: float = math.nan
    period_s: float = math.nan

    @property
    def wear_is_known(self) -> bool:
        """Whether the wear of this cycle can be believed at all."""
        return self.wear.quality is not Quality.BAD and not math.isnan(self.wear.probability_above_limit)


@dataclass(frozen=True, slots=True)
class RuleContext:
    """Settings of a rule in this cell, whether its alarm is active, and what it has told last.

    Attributes
    ----------
    disabled : frozenset of str
        Conditions, by name, that nobody wants to hear of: they explain nothing.
    """

    settings: RuleSettings
    active: bool
    told: Evidence = NO_EVIDENCE
    disabled: frozenset[str] = frozenset()

    @property
    def threshold(self) -> float:
        """What the statistic must pass for the alarm to come, or to stay where it is active."""
        return self.settings.clear_below if self.active else self.settings.activate_above


Evaluate = Callable[[CycleInputs, RuleContext], RuleResult]
"""Says what a rule makes of a cycle."""


@dataclass(frozen=True, slots=True)
class AlarmRule:
    """One condition of a cell.

    Attributes
    ----------
    name : str
        Published name: browse name of the condition, and what journal and logs call it. It never changes.
    node_number, type_number : int
        Identifiers of the condition and of its type in the NodeSet2 file, never used for another; conditions
        are listed in the order of the first.
    title : Message
        What it is called where it has nothing to say.
    description : Message
        What it says, in a sentence; of its node and in the docs.
    settings : RuleSettings
        Defaults of what a cell may choose.
    condition_class : ConditionClass
    input_node : str
        Path of the published variable that it watches; empty for none.
    evaluate : callable or None
        Of a rule that looks at every cycle; None for one of what happens beside the cycles.
    suppressed_by_announcement : bool
        An announced batch change keeps it silent for a while.
    ends_with_surface : bool
        It is of the surface that wears: once that has been renewed, what was told is over.
    explained_by : tuple of str
        Rules by name: while one of them holds or is active, it has called already, and this one does not.
        Here and in the next two, one whose condition is disabled calls nobody and explains nothing.
    explained_at_once_by : tuple of str
        Rules by name that explain this one in a cycle in which they hold, not while they merely stay active.
    may_be_explained_by : tuple of str
        Rules by name that explain this one only where they begin to hold while it is held back.
    logged_by_cause : bool
        What raises it has logged it already.
    calls_again : bool
        What is told anew while it is active is another occurrence, as the fault of another task: it calls for
        attention, whether or not the one before was acknowledged.
    is_occurrence : bool
        It holds in the cycle in which something happens and not in the next: the on-delay of the cell file is
        not for it, and what happens anew while its alarm is active is an event with its own cycle and time.
    is_probability : bool
        Its statistic and threshold are probabilities, which people read in per cent.
    """

    name: str
    node_number: int
    type_number: int
    title: Message
    description: Message
    settings: RuleSettings
    condition_class: ConditionClass = ConditionClass.PROCESS
    input_node: str = ""
    evaluate: Evaluate | None = None
    suppressed_by_announcement: bool = False
    ends_with_surface: bool = False
    explained_by: tuple[str, ...] = ()
    explained_at_once_by: tuple[str, ...] = ()
    may_be_explained_by: tuple[str, ...] = ()
    logged_by_cause: bool = False
    calls_again: bool = False
    is_occurrence: bool = False
    is_probability: bool = False
