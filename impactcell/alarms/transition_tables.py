"""What each event makes of each state of an alarm, as tables after ISA-18.2 and OPC UA Part 9.

Five machines run beside each other in every alarm (OPC 10000-9, 5.5, 5.7, 5.8 and annex B): the first
two of these, and one for each of the three switches.

=============  ====================================================================
annunciation   active x acknowledged x confirmed, six states; see `ANNUNCIATION`
shelving       unshelved, timed, one-shot; see `SHELVING`
switches       enabled, suppressed, out of service; see `SWITCHES`
=============  ====================================================================

A confirmation is asked for after each acknowledgement.
"""

import enum
from collections.abc import Mapping
from types import MappingProxyType

from impactcell.records import Shelving


class EventKind(enum.Enum):
    """What can happen to an alarm: by the process, by a person, by time."""

    ACTIVATE = "activate"
    CLEAR = "clear"
    REALARM = "re-alarm"
    ACKNOWLEDGE = "acknowledge"
    CONFIRM = "confirm"
    COMMENT = "comment"
    SHELVE_TIMED = "shelve for a time"
    SHELVE_ONE_SHOT = "shelve once"
    UNSHELVE = "unshelve"
    SHELVE_EXPIRED = "shelving time is over"
    ENABLE = "enable"
    DISABLE = "disable"
    SUPPRESS = "suppress"
    UNSUPPRESS = "unsuppress"
    REMOVE_FROM_SERVICE = "remove from service"
    PLACE_IN_SERVICE = "place in service"


class Annunciation(enum.Enum):
    """Reachable combinations of (active, acknowledged, confirmed)."""

    NORMAL = (False, True, True)
    UNACKNOWLEDGED = (True, False, True)
    ACKNOWLEDGED = (True, True, False)
    CONFIRMED = (True, True, True)
    CLEARED_UNACKNOWLEDGED = (False, False, True)
    CLEARED_UNCONFIRMED = (False, True, False)


class Refusal(enum.Enum):
    """Why a person's action is not carried out, by its OPC UA status code."""

    DISABLED = "BadConditionDisabled"
    ALREADY_ACKNOWLEDGED = "BadConditionBranchAlreadyAcked"
    ALREADY_CONFIRMED = "BadConditionBranchAlreadyConfirmed"
    ALREADY_ENABLED = "BadConditionAlreadyEnabled"
    ALREADY_DISABLED = "BadConditionAlreadyDisabled"
    ALREADY_SHELVED = "BadConditionAlreadyShelved"
    NOT_SHELVED = "BadConditionNotShelved"
    SHELVING_TIME = "BadShelvingTimeOutOfRange"
    INVALID_STATE = "BadInvalidState"
    ANOTHER_ACTIVATION = "BadEventIdUnknown"


A, E, R = Annunciation, EventKind, Refusal

ANNUNCIATION: Mapping[tuple[Annunciation, EventKind], Annunciation | Refusal] = MappingProxyType(
    {
        (A.NORMAL, E.ACTIVATE): A.UNACKNOWLEDGED,
        (A.NORMAL, E.CLEAR): A.NORMAL,
        (A.NORMAL, E.REALARM): A.NORMAL,
        (A.NORMAL, E.ACKNOWLEDGE): R.ALREADY_ACKNOWLEDGED,
        (A.NORMAL, E.CONFIRM): R.ALREADY_CONFIRMED,
        (A.UNACKNOWLEDGED, E.ACTIVATE): A.UNACKNOWLEDGED,
        (A.UNACKNOWLEDGED, E.CLEAR): A.CLEARED_UNACKNOWLEDGED,
        (A.UNACKNOWLEDGED, E.REALARM): A.UNACKNOWLEDGED,
        (A.UNACKNOWLEDGED, E.ACKNOWLEDGE): A.ACKNOWLEDGED,
        (A.UNACKNOWLEDGED, E.CONFIRM): R.ALREADY_CONFIRMED,
        (A.ACKNOWLEDGED, E.ACTIVATE): A.ACKNOWLEDGED,
        (A.ACKNOWLEDGED, E.CLEAR): A.CLEARED_UNCONFIRMED,
        (A.ACKNOWLEDGED, E.REALARM): A.UNACKNOWLEDGED,
        (A.ACKNOWLEDGED, E.ACKNOWLEDGE): R.ALREADY_ACKNOWLEDGED,
        (A.ACKNOWLEDGED, E.CONFIRM): A.CONFIRMED,
        (A.CONFIRMED, E.ACTIVATE): A.CONFIRMED,
        (A.CONFIRMED, E.CLEAR): A.NORMAL,
        (A.CONFIRMED, E.REALARM): A.UNACKNOWLEDGED,
        (A.CONFIRMED, E.ACKNOWLEDGE): R.ALREADY_ACKNOWLEDGED,
        (A.CONFIRMED, E.CONFIRM): R.ALREADY_CONFIRMED,
        (A.CLEARED_UNACKNOWLEDGED, E.ACTIVATE): A.UNACKNOWLEDGED,
        (A.CLEARED_UNACKNOWLEDGED, E.CLEAR): A.CLEARED_UNACKNOWLEDGED,
        (A.CLEARED_UNACKNOWLEDGED, E.REALARM): A.CLEARED_UNACKNOWLEDGED,
        (A.CLEARED_UNACKNOWLEDGED, E.ACKNOWLEDGE): A.CLEARED_UNCONFIRMED,
        (A.CLEARED_UNACKNOWLEDGED, E.CONFIRM): R.ALREADY_CONFIRMED,
        (A.CLEARED_UNCONFIRMED, E.ACTIVATE): A.UNACKNOWLEDGED,
        (A.CLEARED_UNCONFIRMED, E.CLEAR): A.CLEARED_UNCONFIRMED,
        (A.CLEARED_UNCONFIRMED, E.REALARM): A.CLEARED_UNCONFIRMED,
        (A.CLEARED_UNCONFIRMED, E.ACKNOWLEDGE): R.ALREADY_ACKNOWLEDGED,
        (A.CLEARED_UNCONFIRMED, E.CONFIRM): A.NORMAL,
    }
)

S = Shelving
SHELVING: Mapping[tuple[Shelving, EventKind], Shelving | Refusal] = MappingProxyType(
    {
        (S.UNSHELVED, E.SHELVE_TIMED): S.TIMED,
        (S.UNSHELVED, E.SHELVE_ONE_SHOT): S.ONE_SHOT,
        (S.UNSHELVED, E.UNSHELVE): R.NOT_SHELVED,
        (S.UNSHELVED, E.SHELVE_EXPIRED): S.UNSHELVED,
        (S.UNSHELVED, E.CLEAR): S.UNSHELVED,
        (S.TIMED, E.SHELVE_TIMED): R.ALREADY_SHELVED,
        (S.TIMED, E.SHELVE_ONE_SHOT): S.ONE_SHOT,
        (S.TIMED, E.UNSHELVE): S.UNSHELVED,
        (S.TIMED, E.SHELVE_EXPIRED): S.UNSHELVED,
        (S.TIMED, E.CLEAR): S.TIMED,
        (S.ONE_SHOT, E.SHELVE_TIMED): S.TIMED,
        (S.ONE_SHOT, E.SHELVE_ONE_SHOT): R.ALREADY_SHELVED,
        (S.ONE_SHOT, E.UNSHELVE): S.UNSHELVED,
        # a longest shelving time holds for one-shot shelving too
        (S.ONE_SHOT, E.SHELVE_EXPIRED): S.UNSHELVED,
        (S.ONE_SHOT, E.CLEAR): S.UNSHELVED,
    }
)

SWITCHES: Mapping[tuple[str, bool, EventKind], bool | Refusal] = MappingProxyType(
    {
        ("enabled", False, E.ENABLE): True,
        ("enabled", True, E.ENABLE): R.ALREADY_ENABLED,
        ("enabled", True, E.DISABLE): False,
        ("enabled", False, E.DISABLE): R.ALREADY_DISABLED,
        ("suppressed", False, E.SUPPRESS): True,
        ("suppressed", True, E.SUPPRESS): True,
        ("suppressed", False, E.UNSUPPRESS): False,
        ("suppressed", True, E.UNSUPPRESS): False,
        ("out_of_service", False, E.REMOVE_FROM_SERVICE): True,
        ("out_of_service", True, E.REMOVE_FROM_SERVICE): R.INVALID_STATE,
        ("out_of_service", True, E.PLACE_IN_SERVICE): False,
        ("out_of_service", False, E.PLACE_IN_SERVICE): R.INVALID_STATE,
    }
)

# A disabled condition is not processed: people and rules are refused or ignored, time and switches go on.
DISABLED: Mapping[EventKind, Refusal | None] = MappingProxyType(
    {
        E.ACTIVATE: None,
        E.CLEAR: None,
        E.REALARM: None,
        E.ACKNOWLEDGE: R.DISABLED,
        E.CONFIRM: R.DISABLED,
        E.COMMENT: R.DISABLED,
        E.SHELVE_TIMED: R.DISABLED,
        E.SHELVE_ONE_SHOT: R.DISABLED,
        E.UNSHELVE: R.DISABLED,
    }
)
