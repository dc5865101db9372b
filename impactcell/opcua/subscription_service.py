"""Subscription and MonitoredItem services (Part 4, 5.13 and 5.14) for all sessions.

Mended: see `subscriptions` and `items`; and asyncua lets every session use, and delete, the subscriptions
of others.
"""

import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Any, Final

from asyncua import ua

from impactcell.opcua import notification_encoding
from impactcell.opcua.binary_codec import FaultError, service_fault
from impactcell.opcua.event_notification import EventNotification
from impactcell.opcua.host_interface import ServerLimits
from impactcell.opcua.monitored_item import EventItem
from impactcell.opcua.request_dispatch import Context, Service, bounded
from impactcell.opcua.sessions import PublishRequest, Session
from impactcell.opcua.subscription import Item, Subscription

WAITING_REQUESTS: Final = 100


class Monitoring:
    """Holds all subscriptions and answers what clients ask of them."""

    def __init__(self, limits: ServerLimits) -> None:
        self._limits = limits
        self._subscriptions: dict[int, Subscription] = {}
        self._last_id = 0
        self._event_items: dict[ua.NodeId, dict[EventItem, Subscription]] = {}

    def __len__(self) -> int:
        return len(self._subscriptions)

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "CreateSubscription": Service(ua.CreateSubscriptionParameters, self.create),
            "ModifySubscription": Service(ua.ModifySubscriptionParameters, self.modify),
            "SetPublishingMode": Service(ua.SetPublishingModeParameters, self.set_publishing),
            "DeleteSubscriptions": Service(ua.DeleteSubscriptionsParameters, self.delete),
            "TransferSubscriptions": Service(ua.TransferSubscriptionsParameters, self.transfer),
            "Publish": Service(ua.PublishParameters, self.publish),
            "Republish": Service(ua.RepublishParameters, self.republish),
        }

    def of(self, session: Session) -> list[Subscription]:
        """List the subscriptions of a session."""
        return [found for found in self._subscriptions.values() if found.session is session]

    def find(self, number: int, session: Session) -> Subscription:
        """Find a subscription of a session.

        Raises
        ------
        FaultError
            BadSubscriptionIdInvalid: there is none, or it is another session's.
        """
        found = self._subscriptions.get(number)
        if found is None or found.session is not session:
            raise FaultError(ua.StatusCodes.BadSubscriptionIdInvalid)
        return found

    def event(self, event: EventNotification) -> None:
        """Tell an event to all who listen to one of its notifiers."""
        for notifier in event.notifiers:
            for item in tuple(self._event_items.get(notifier, ())):
                item.offer(event)

    def refresh(
        self, session: Session, number: int, item_id: int | None, events: Sequence[EventNotification]
    ) -> None:
        """Tell events again to one subscription, or to one item of it.

        Raises
        ------
        FaultError
            BadSubscriptionIdInvalid or BadMonitoredItemIdInvalid.
        """
        found = self.find(number, session)
        items = list(found.items.values()) if item_id is None else [found.item(item_id)]
        listening = [item for item in items if isinstance(item, EventItem)]
        if item_id is not None and not listening:
            raise FaultError(ua.StatusCodes.BadMonitoredItemIdInvalid)
        for item in listening:
            for event in events:
                if event.unfiltered or item.notifier in event.notifiers:
                    item.offer(event)

    def end_session(self, session: Session, *, delete: bool) -> None:
        """Delete the subscriptions of a session that ends, or leave them to be transferred."""
        for found in self.of(session):
            if delete:
                self._remove(found)
            else:
                found.session = None

    def close(self) -> None:
        """End all subscriptions."""
        for found in tuple(self._subscriptions.values()):
            self._remove(found)

    def _remove(self, found: Subscription) -> None:
        for item in tuple(found.items.values()):
            self.forget(item)
        found.close()
        self._subscriptions.pop(found.id, None)

    def listen(self, item: EventItem, found: Subscription) -> None:
        """Tell an item of events from now on."""
        self._event_items.setdefault(item.notifier, {})[item] = found

    def forget(self, item: Item) -> None:
        """Tell an item no more."""
        if isinstance(item, EventItem):
            listening = self._event_items.get(item.notifier, {})
            listening.pop(item, None)
            if not listening:
                self._event_items.pop(item.notifier, None)

    async def create(
        self, context: Context, wanted: ua.CreateSubscriptionParameters
    ) -> ua.CreateSubscriptionResponse:
        """Begin a subscription."""
        mine = self.of(context.session)
        if (
            len(mine) >= self._limits.subscriptions_per_session
            or len(self._subscriptions) >= self._limits.subscriptions
        ):
            raise FaultError(ua.StatusCodes.BadTooManySubscriptions)
        self._last_id += 1
        made = Subscription(self._last_id, context.session, wanted, self._limits, self._remove)
        self._subscriptions[made.id] = made
        response = ua.CreateSubscriptionResponse()
        response.Parameters.SubscriptionId = made.id
        _revise(made, response.Parameters)
        return response

    async def modify(
        self, context: Context, wanted: ua.ModifySubscriptionParameters
    ) -> ua.ModifySubscriptionResponse:
        """Change the interval and the counts."""
        found = self.find(wanted.SubscriptionId, context.session)
        found.configure(wanted)
        response = ua.ModifySubscriptionResponse()
        _revise(found, response.Parameters)
        return response

    async def set_publishing(
        self, context: Context, wanted: ua.SetPublishingModeParameters
    ) -> ua.SetPublishingModeResponse:
        """Switch the reports of subscriptions on or off."""

        def switch(number: int) -> None:
            self.find(number, context.session).enabled = wanted.PublishingEnabled

        response = ua.SetPublishingModeResponse()
        response.Parameters.Results = each(wanted.SubscriptionIds, switch)
        return response

    async def delete(
        self, context: Context, wanted: ua.DeleteSubscriptionsParameters
    ) -> ua.DeleteSubscriptionsResponse:
        """End subscriptions."""
        response = ua.DeleteSubscriptionsResponse()
        response.Results = each(
            wanted.SubscriptionIds, lambda number: self._remove(self.find(number, context.session))
        )
        if not self.of(context.session):
            self._return_requests(context.session)
        return response

    @staticmethod
    def _return_requests(session: Session) -> None:
        while session.publish_requests and session.connection is not None:
            request = session.publish_requests.popleft()
            fault = service_fault(request.handle, ua.StatusCodes.BadNoSubscription)
            session.connection.respond(request.request_id, request.handle, fault)

    async def transfer(
        self, context: Context, wanted: ua.TransferSubscriptionsParameters
    ) -> ua.TransferSubscriptionsResponse:
        """Take over subscriptions of an earlier session of the same user."""
        response = ua.TransferSubscriptionsResponse()
        results = []
        for number in bounded(wanted.SubscriptionIds):
            result = ua.TransferResult()
            found = self._subscriptions.get(number)
            if found is None:
                result.StatusCode = ua.StatusCode(ua.StatusCodes.BadSubscriptionIdInvalid)
            elif found.owner != context.actor.user:
                result.StatusCode = ua.StatusCode(ua.StatusCodes.BadUserAccessDenied)
            elif found.session is not context.session and (
                len(self.of(context.session)) >= self._limits.subscriptions_per_session
            ):
                result.StatusCode = ua.StatusCode(ua.StatusCodes.BadTooManySubscriptions)
            else:
                result.AvailableSequenceNumbers = found.available()
                found.move(context.session, initial=wanted.SendInitialValues)
            results.append(result)
        response.Parameters.Results = results
        return response

    async def publish(self, context: Context, wanted: ua.PublishParameters) -> None:
        """Acknowledge, and wait in line for the next thing to say."""
        session = context.session
        results = [self._acknowledge(session, a) for a in wanted.SubscriptionAcknowledgements or []]
        mine = self.of(session)
        if not mine:
            raise FaultError(ua.StatusCodes.BadNoSubscription)
        hint = context.header.TimeoutHint
        expires = time.monotonic() + hint / 1e3 if hint else float("inf")
        self._drop_expired(session)
        session.publish_requests.append(
            PublishRequest(context.request_id, context.header.RequestHandle, results, expires)
        )
        if len(session.publish_requests) > WAITING_REQUESTS:
            self._fault_oldest(session, ua.StatusCodes.BadTooManyPublishRequests)
        for found in sorted(mine, key=lambda s: -s.priority):
            found.serve()

    def _acknowledge(self, session: Session, wanted: ua.SubscriptionAcknowledgement) -> ua.StatusCode:
        try:
            found = self.find(wanted.SubscriptionId, session)
        except FaultError as fault:
            return ua.StatusCode(fault.code)
        return ua.StatusCode(found.acknowledge(wanted.SequenceNumber))

    def _drop_expired(self, session: Session) -> None:
        now = time.monotonic()
        while session.publish_requests and session.publish_requests[0].expires < now:
            self._fault_oldest(session, ua.StatusCodes.BadTimeout)

    @staticmethod
    def _fault_oldest(session: Session, code: int) -> None:
        oldest = session.publish_requests.popleft()
        if session.connection is not None:
            session.connection.respond(oldest.request_id, oldest.handle, service_fault(oldest.handle, code))

    async def republish(self, context: Context, wanted: ua.RepublishParameters) -> bytes:
        """Send a message again that was not acknowledged."""
        message = self.find(wanted.SubscriptionId, context.session).message(wanted.RetransmitSequenceNumber)
        return notification_encoding.republish_response(
            context.header.RequestHandle, datetime.now(UTC), message
        )


def each(numbers: list[int], work: Callable[[int], None]) -> list[ua.StatusCode]:
    """Do something to each of a list of ids; the status codes."""
    results = []
    for number in bounded(numbers):
        try:
            work(number)
            results.append(ua.StatusCode())
        except FaultError as fault:
            results.append(ua.StatusCode(fault.code))
    return results


def _revise(found: Subscription, result: Any) -> None:
    result.RevisedPublishingInterval = found.interval_s * 1e3
    result.RevisedLifetimeCount = found.lifetime
    result.RevisedMaxKeepAliveCount = found.keep_alive
