"""Methods of cells and conditions: from a Call to the service, with rights, ranges and an audit trail."""

import math
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from typing import Any, Final

from asyncua import ua

from impactcell.alarms import EventKind
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.event_notification import EventNotification
from impactcell.opcua.services.method_service import (
    InputArgument,
    InvalidArgumentError,
    Method,
    MethodService,
)
from impactcell.opcua.sessions.request_dispatch import RequestContext
from impactcell.opcua.subscriptions.subscription_service import SubscriptionService
from impactcell.quantities import BY_PATH, MILLIMETRE
from impactcell.scada.access_policy import CellAccess
from impactcell.scada.audit_log import MethodAudit
from impactcell.scada.cell_nodes import CellSpace
from impactcell.scada.conditions import MAX_SHELVE_S, Condition, refresh_event
from impactcell.scada.interface import Actions, CellDescription
from impactcell.scada.rights import CONDITION_AREAS, Area

MAX_BATCH_ID: Final = 64
"""Longest name of a batch, characters."""
MAX_COMMENT: Final = 1_000
"""Longest comment, characters."""

NAMES_EVENT: Final = (EventKind.ACKNOWLEDGE, EventKind.CONFIRM, EventKind.COMMENT)
"""Actions that name the event they answer: one that came meanwhile is not acknowledged unseen."""

_EVENT_ID: Final = InputArgument("EventId", ua.VariantType.ByteString)
_COMMENT: Final = InputArgument("Comment", ua.VariantType.LocalizedText)
_SHELVING_TIME: Final = InputArgument("ShelvingTime", ua.VariantType.Double)

_ids = ua.ObjectIds
# Action: name of the method, its NodeIds on the types, its arguments.
_CONDITION_METHODS: Final[Mapping[EventKind, tuple[str, tuple[int, ...], tuple[InputArgument, ...]]]] = {
    EventKind.ENABLE: ("Enable", (_ids.ConditionType_Enable,), ()),
    EventKind.DISABLE: ("Disable", (_ids.ConditionType_Disable,), ()),
    EventKind.COMMENT: ("AddComment", (_ids.ConditionType_AddComment,), (_EVENT_ID, _COMMENT)),
    EventKind.ACKNOWLEDGE: (
        "Acknowledge",
        (_ids.AcknowledgeableConditionType_Acknowledge,),
        (_EVENT_ID, _COMMENT),
    ),
    EventKind.CONFIRM: ("Confirm", (_ids.AcknowledgeableConditionType_Confirm,), (_EVENT_ID, _COMMENT)),
    EventKind.SHELVE_TIMED: (
        "ShelvingState/TimedShelve",
        (_ids.ShelvedStateMachineType_TimedShelve, _ids.AlarmConditionType_ShelvingState_TimedShelve),
        (_SHELVING_TIME,),
    ),
    EventKind.SHELVE_ONE_SHOT: (
        "ShelvingState/OneShotShelve",
        (_ids.ShelvedStateMachineType_OneShotShelve, _ids.AlarmConditionType_ShelvingState_OneShotShelve),
        (),
    ),
    EventKind.UNSHELVE: (
        "ShelvingState/Unshelve",
        (_ids.ShelvedStateMachineType_Unshelve, _ids.AlarmConditionType_ShelvingState_Unshelve),
        (),
    ),
}


class MethodTable:
    """Makes methods callable; tells the access policy in which area they lie, and the audit their names."""

    def __init__(self, methods: MethodService, access: CellAccess, audit: MethodAudit) -> None:
        self._methods = methods
        self._access = access
        self._audit = audit

    def bind(
        self, owner: ua.NodeId, method_id: ua.NodeId, area: Area, method: Method, audit_name: str = ""
    ) -> None:
        """Make a method callable on an object; without a name it is not audited."""
        self._methods.bind(owner, method_id, method)
        self._access.add_method(method_id, area)
        self._audit.add_method(owner, method_id, audit_name)


def comment_fault(text: str) -> str:
    """Say why a text can be no comment; empty where it can.

    What a client sends as Latin-1 comes out of the codec with half characters in it, which nothing can write.
    """
    if len(text) > MAX_COMMENT:
        return f"a comment has at most {MAX_COMMENT} characters"
    try:
        text.encode()
    except UnicodeEncodeError:
        return "a comment is text in UTF-8"
    return ""


def _comment_text(value: object, index: int) -> str:
    """Take a comment; an absent one is empty."""
    text = (value.Text or "") if isinstance(value, ua.LocalizedText) else ""
    if comment_fault(text):
        raise InvalidArgumentError(index, ua.StatusCodes.BadOutOfRange)
    return text


def bind_cell(table: MethodTable, space: CellSpace, types: Mapping[str, ua.NodeId], actions: Actions) -> None:
    """Make the methods of a cell callable."""
    description: CellDescription = space.description
    cell = description.name

    async def start_batch(context: RequestContext, arguments: Sequence[Any]) -> None:
        batch, expected = (arguments[0] or "").strip(), arguments[1]
        if not 0 < len(batch) <= MAX_BATCH_ID or not batch.isprintable():
            raise InvalidArgumentError(0, ua.StatusCodes.BadOutOfRange)
        await actions.start_batch(cell, batch, expected=expected, actor=context.actor)

    async def reset_wear(context: RequestContext, arguments: Sequence[Any]) -> None:
        await actions.reset_wear(cell, _comment_text(arguments[0], 0), context.actor)

    async def set_target(context: RequestContext, arguments: Sequence[Any]) -> None:
        target, allowed = arguments[0], BY_PATH["Positioning/Target"].node_range(description.ranges)
        if not math.isfinite(target) or allowed is None or not allowed[0] <= target <= allowed[1]:
            raise InvalidArgumentError(0, ua.StatusCodes.BadOutOfRange)
        await actions.set_target(cell, target / MILLIMETRE.per_si, context.actor)

    async def abort(context: RequestContext, _arguments: Sequence[Any]) -> None:
        await actions.abort_positioning(cell, context.actor)

    string, boolean = ua.VariantType.String, ua.VariantType.Boolean
    for name, area, arguments, handler in (
        (
            "StartBatch",
            Area.START_BATCH,
            (InputArgument("BatchId", string), InputArgument("Expected", boolean)),
            start_batch,
        ),
        ("ResetWear", Area.RESET_WEAR, (_COMMENT,), reset_wear),
        ("SetTarget", Area.SET_TARGET, (InputArgument("Target", ua.VariantType.Double),), set_target),
        ("AbortPositioning", Area.ABORT_POSITIONING, (), abort),
    ):
        method = Method(arguments, handler)
        for method_id in (space.path(name), types[name]):
            table.bind(space.node, method_id, area, method, f"{cell}: {name}")


def bind_condition(table: MethodTable, space: CellSpace, condition: Condition, actions: Actions) -> None:
    """Make the methods of a condition callable, on itself and on its shelving state."""
    shelving = space.path(f"{condition.name}/ShelvingState")
    for event, (name, type_ids, arguments) in _CONDITION_METHODS.items():
        method = Method(arguments, _action(condition, event, actions))
        instance_method = space.path(f"{condition.name}/{name}")
        audit_name = f"{condition.cell}: {condition.name}: {name.rpartition('/')[2]}"
        for owner in (condition.node, shelving) if "/" in name else (condition.node,):
            for method_id in (instance_method, *(ua.NodeId(type_id) for type_id in type_ids)):
                table.bind(owner, method_id, CONDITION_AREAS[event], method, audit_name)


def _action(
    condition: Condition, event: EventKind, actions: Actions
) -> Callable[[RequestContext, Sequence[Any]], Awaitable[None]]:
    async def act(context: RequestContext, arguments: Sequence[Any]) -> None:
        comment, shelve_s, activation = "", 0.0, None
        if event in NAMES_EVENT:
            if condition.alarm.enabled and not condition.is_current_event(arguments[0]):
                raise StatusCodeError(ua.StatusCodes.BadEventIdUnknown)
            activation = condition.alarm.activation
            comment = _comment_text(arguments[1], 1)
            if event is EventKind.COMMENT and not comment:  # Part 9, 5.5.6
                raise InvalidArgumentError(1, ua.StatusCodes.BadOutOfRange)
        elif event is EventKind.SHELVE_TIMED:
            shelve_s = arguments[0] / 1e3
            if not 0.0 < shelve_s <= MAX_SHELVE_S:
                raise StatusCodeError(ua.StatusCodes.BadShelvingTimeOutOfRange)
        elif event is EventKind.SHELVE_ONE_SHOT:
            shelve_s = MAX_SHELVE_S
        await actions.act_on_condition(
            condition.cell,
            condition.name,
            event,
            context.actor,
            comment=comment,
            shelve_s=shelve_s,
            activation=activation,
        )

    return act


def bind_refresh(
    table: MethodTable,
    subscriptions: SubscriptionService,
    conditions: Mapping[tuple[str, str], Condition],
) -> None:
    """Make ConditionRefresh and ConditionRefresh2 callable."""

    def events() -> Iterator[EventNotification]:
        yield refresh_event(_ids.RefreshStartEventType)
        yield from filter(None, (condition.present() for condition in conditions.values()))
        yield refresh_event(_ids.RefreshEndEventType)

    async def refresh(context: RequestContext, arguments: Sequence[Any]) -> None:
        await subscriptions.refresh(context, arguments[0], None, events())

    async def refresh_item(context: RequestContext, arguments: Sequence[Any]) -> None:
        await subscriptions.refresh(context, arguments[0], arguments[1], events())

    id_type = ua.VariantType.UInt32
    refresh_method = Method((InputArgument("SubscriptionId", id_type),), refresh)
    refresh_item_method = Method(
        (InputArgument("SubscriptionId", id_type), InputArgument("MonitoredItemId", id_type)), refresh_item
    )
    owner = ua.NodeId(_ids.ConditionType)
    table.bind(owner, ua.NodeId(_ids.ConditionType_ConditionRefresh), Area.REFRESH, refresh_method)
    table.bind(owner, ua.NodeId(_ids.ConditionType_ConditionRefresh2), Area.REFRESH, refresh_item_method)
