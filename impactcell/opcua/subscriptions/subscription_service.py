"""Subscription services (Part 4, 5.14) for all sessions.

Mended: see `subscription` and `monitored_item`; asyncua lets every session use, and delete, those of others.
"""

import asyncio
import time
from collections import deque
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any, Final

from asyncua import ua

from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.event_notification import EventNotification
from impactcell.opcua.fan_out import FanOut
from impactcell.opcua.host_interface import ServerLimits
from impactcell.opcua.languages import Languages
from impactcell.opcua.sessions.request_dispatch import (
    RequestContext,
    Service,
    apply_to_each,
    check_operations,
)
from impactcell.opcua.sessions.session_table import PublishRequest, Session
from impactcell.opcua.subscriptions import notification_encoding, publish_queue
from impactcell.opcua.subscriptions.item_room import ItemRoom
from impactcell.opcua.subscriptions.monitored_item import EventMonitoredItem
from impactcell.opcua.subscriptions.ready_items import MonitoredItem
from impactcell.opcua.subscriptions.subscription import Subscription

MAX_ACKNOWLEDGEMENTS: Final = 1_000
"""Acknowledgements in one Publish request."""
CLOSED_AT_ONCE: Final = 100
"""Items of subscriptions that have ended that are closed in one round of the loop: some 0.2 ms."""
EVENTS_AT_ONCE: Final = 10
"""Listeners to events that are told at once in a round; each has fields of its own: some 3 ms."""


class SubscriptionService:
    """Holds all subscriptions and answers what clients ask of them."""

    def __init__(self, limits: ServerLimits, languages: Languages) -> None:
        self._limits = limits
        self._languages = languages
        self._subscriptions: dict[int, Subscription] = {}
        self._last_id = 0
        self._fan_out = FanOut(EVENTS_AT_ONCE)
        self._ended_items = deque[MonitoredItem]()
        self._refreshing = set[int]()
        self._event_items: dict[ua.NodeId, dict[EventMonitoredItem, Subscription]] = {}

    def __len__(self) -> int:
        return len(self._subscriptions)

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "CreateSubscription": Service(ua.CreateSubscriptionParameters, self.create_subscription),
            "ModifySubscription": Service(ua.ModifySubscriptionParameters, self.modify_subscription),
            "SetPublishingMode": Service(ua.SetPublishingModeParameters, self.set_publishing_mode),
            "DeleteSubscriptions": Service(ua.DeleteSubscriptionsParameters, self.delete_subscriptions),
            "TransferSubscriptions": Service(ua.TransferSubscriptionsParameters, self.transfer_subscriptions),
            "Publish": Service(ua.PublishParameters, self.publish),
            "Republish": Service(ua.RepublishParameters, self.republish),
        }

    def subscriptions_of(self, session: Session) -> list[Subscription]:
        """List the subscriptions of a session."""
        return [
            subscription for subscription in self._subscriptions.values() if subscription.session is session
        ]

    def find(self, number: int, session: Session) -> Subscription:
        """Find a subscription of a session.

        Raises
        ------
        StatusCodeError
            BadSubscriptionIdInvalid: there is none, or it is another session's.
        """
        subscription = self._subscriptions.get(number)
        if subscription is None or subscription.session is not session:
            raise StatusCodeError(ua.StatusCodes.BadSubscriptionIdInvalid)
        return subscription

    def notify(self, notify: EventNotification) -> None:
        """Tell an event to all who listen to one of its notifiers."""
        for notifier in notify.notifiers:
            self._fan_out.deliver((item.offer for item in self._event_items.get(notifier, ())), notify)

    async def refresh(
        self, context: RequestContext, number: int, item_id: int | None, events: Iterable[EventNotification]
    ) -> None:
        """Tell events again to one subscription, or to one item of it; they are made one by one.

        Raises
        ------
        StatusCodeError
            BadSubscriptionIdInvalid, BadMonitoredItemIdInvalid, or BadRefreshInProgress (Part 9, 5.5.7).
        """
        subscription = self.find(number, context.session)
        items = list(subscription.items.values()) if item_id is None else [subscription.item(item_id)]
        listening = [item for item in items if isinstance(item, EventMonitoredItem)]
        if item_id is not None and not listening:
            raise StatusCodeError(ua.StatusCodes.BadMonitoredItemIdInvalid)

        def deliver(notify: EventNotification) -> None:
            self._fan_out.deliver(
                (item.offer for item in listening if notify.unfiltered or item.notifier in notify.notifiers),
                notify,
            )

        if number in self._refreshing:
            raise StatusCodeError(ua.StatusCodes.BadRefreshInProgress)
        self._refreshing.add(number)
        try:
            await context.share.each(events, deliver)
        finally:
            self._refreshing.discard(number)

    def end_session(self, session: Session, *, delete: bool) -> None:
        """Delete the subscriptions of a session that ends, or leave them to be transferred."""
        for subscription in self.subscriptions_of(session):
            if delete:
                self._remove(subscription)
            else:
                subscription.session = None

    def close(self) -> None:
        """End all subscriptions."""
        for subscription in tuple(self._subscriptions.values()):
            self._remove(subscription)

    def _remove(self, subscription: Subscription) -> None:
        self._subscriptions.pop(subscription.id, None)
        if not self._ended_items:
            asyncio.get_running_loop().call_soon(self._close_items)
        self._ended_items.extend(subscription.close())

    def _close_items(self) -> None:
        for _ in range(min(CLOSED_AT_ONCE, len(self._ended_items))):
            item = self._ended_items.popleft()
            self.forget(item)
            item.close()
        if self._ended_items:
            asyncio.get_running_loop().call_soon(self._close_items)

    def listen(self, item: EventMonitoredItem, subscription: Subscription) -> None:
        """Tell an item of events from now on."""
        self._event_items.setdefault(item.notifier, {})[item] = subscription

    def forget(self, item: MonitoredItem) -> None:
        """Tell an item no more."""
        if isinstance(item, EventMonitoredItem):
            listening = self._event_items.get(item.notifier, {})
            listening.pop(item, None)
            if not listening:
                self._event_items.pop(item.notifier, None)

    async def create_subscription(
        self, context: RequestContext, parameters: ua.CreateSubscriptionParameters
    ) -> ua.CreateSubscriptionResponse:
        """Begin a subscription."""
        subscriptions = self.subscriptions_of(context.session)
        if (
            len(subscriptions) >= self._limits.subscriptions_per_session
            or len(self._subscriptions) >= self._limits.subscriptions
        ):
            raise StatusCodeError(ua.StatusCodes.BadTooManySubscriptions)
        self._last_id += 1
        subscription = Subscription(
            self._last_id, context.session, parameters, self._limits, self._languages, self._remove
        )
        self._subscriptions[subscription.id] = subscription
        response = ua.CreateSubscriptionResponse()
        response.Parameters.SubscriptionId = subscription.id
        _revise(subscription, response.Parameters)
        return response

    async def modify_subscription(
        self, context: RequestContext, parameters: ua.ModifySubscriptionParameters
    ) -> ua.ModifySubscriptionResponse:
        """Change the interval and the counts."""
        subscription = self.find(parameters.SubscriptionId, context.session)
        subscription.configure(parameters)
        response = ua.ModifySubscriptionResponse()
        _revise(subscription, response.Parameters)
        return response

    async def set_publishing_mode(
        self, context: RequestContext, parameters: ua.SetPublishingModeParameters
    ) -> ua.SetPublishingModeResponse:
        """Switch the reports of subscriptions on or off."""

        def switch(number: int) -> None:
            self.find(number, context.session).enabled = parameters.PublishingEnabled

        response = ua.SetPublishingModeResponse()
        response.Parameters.Results = await apply_to_each(context.share, parameters.SubscriptionIds, switch)
        return response

    async def delete_subscriptions(
        self, context: RequestContext, parameters: ua.DeleteSubscriptionsParameters
    ) -> ua.DeleteSubscriptionsResponse:
        """End subscriptions."""
        response = ua.DeleteSubscriptionsResponse()
        response.Results = await apply_to_each(
            context.share,
            parameters.SubscriptionIds,
            lambda number: self._remove(self.find(number, context.session)),
        )
        if not self.subscriptions_of(context.session):
            publish_queue.return_all(context.session)
        return response

    async def transfer_subscriptions(
        self, context: RequestContext, parameters: ua.TransferSubscriptionsParameters
    ) -> ua.TransferSubscriptionsResponse:
        """Take over subscriptions of an earlier session of the same user."""
        response = ua.TransferSubscriptionsResponse()
        numbers = check_operations(parameters.SubscriptionIds)
        response.Parameters.Results = await context.share.each(
            numbers, lambda number: self._transfer(number, context)
        )
        if parameters.SendInitialValues:
            for number, result in dict(zip(numbers, response.Parameters.Results, strict=True)).items():
                if result.StatusCode.is_good() and number in self._subscriptions:
                    await self._subscriptions[number].repeat_values(context.share)
        return response

    def _transfer(self, number: int, context: RequestContext) -> ua.TransferResult:
        result = ua.TransferResult()
        subscription = self._subscriptions.get(number)
        if subscription is None:
            result.StatusCode = ua.StatusCode(ua.StatusCodes.BadSubscriptionIdInvalid)
        elif subscription.owner != context.actor.user:
            result.StatusCode = ua.StatusCode(ua.StatusCodes.BadUserAccessDenied)
        elif subscription.session is not context.session and (
            len(self.subscriptions_of(context.session)) >= self._limits.subscriptions_per_session
        ):
            result.StatusCode = ua.StatusCode(ua.StatusCodes.BadTooManySubscriptions)
        else:
            result.AvailableSequenceNumbers = subscription.available_sequence_numbers()
            subscription.move(context.session)
        return result

    def room_for_items(self, owner: str) -> ItemRoom:
        """How many more monitored items a user may have."""
        items, events = self._limits.items_per_user, self._limits.event_items_per_user
        for subscription in self._subscriptions.values():
            if subscription.owner == owner:
                items -= len(subscription.items)
        for listening in self._event_items.values():
            events -= sum(1 for subscription in listening.values() if subscription.owner == owner)
        return ItemRoom(items, events)

    async def publish(self, context: RequestContext, parameters: ua.PublishParameters) -> None:
        """Acknowledge, and wait in line for the next thing to say."""
        session = context.session
        acknowledgements = parameters.SubscriptionAcknowledgements or []
        if len(acknowledgements) > MAX_ACKNOWLEDGEMENTS:
            raise StatusCodeError(ua.StatusCodes.BadTooManyOperations)
        results = notification_encoding.status_codes(
            await context.share.each(acknowledgements, lambda a: self._acknowledge(session, a))
        )
        if session.connection is not context.connection:  # it has moved to another meanwhile
            raise StatusCodeError(ua.StatusCodes.BadSecureChannelIdInvalid)
        subscriptions = self.subscriptions_of(session)
        if not subscriptions:
            raise StatusCodeError(ua.StatusCodes.BadNoSubscription)
        hint = context.header.TimeoutHint
        expires = time.monotonic() + hint / 1e3 if hint else float("inf")
        request = PublishRequest(context.request_id, context.header.RequestHandle, results, expires)
        publish_queue.wait_in_line(session, request)
        for subscription in sorted(subscriptions, key=lambda s: -s.priority):
            subscription.serve()

    def _acknowledge(self, session: Session, parameters: ua.SubscriptionAcknowledgement) -> int:
        try:
            subscription = self.find(parameters.SubscriptionId, session)
        except StatusCodeError as fault:
            return fault.code
        return subscription.acknowledge(parameters.SequenceNumber)

    async def republish(self, context: RequestContext, parameters: ua.RepublishParameters) -> bytes:
        """Send a message again that was not acknowledged."""
        message = self.find(parameters.SubscriptionId, context.session).message(
            parameters.RetransmitSequenceNumber
        )
        return notification_encoding.republish_response(
            context.header.RequestHandle, datetime.now(UTC), message
        )


def _revise(subscription: Subscription, result: Any) -> None:
    result.RevisedPublishingInterval = subscription.interval_s * 1e3
    result.RevisedLifetimeCount = subscription.lifetime_count
    result.RevisedMaxKeepAliveCount = subscription.max_keep_alive_count
