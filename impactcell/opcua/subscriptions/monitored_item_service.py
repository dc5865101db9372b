"""MonitoredItem services (Part 4, 5.13)."""

from typing import Any

from asyncua import ua

from impactcell.opcua.address_space.variable_store import VariableStore
from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.host_interface import AccessPolicy, Permission, Role, ServerLimits
from impactcell.opcua.sessions.request_dispatch import (
    RequestContext,
    Service,
    apply_to_each,
    check_operations,
)
from impactcell.opcua.subscriptions.item_room import ItemRoom
from impactcell.opcua.subscriptions.monitored_item import DataMonitoredItem, EventMonitoredItem
from impactcell.opcua.subscriptions.ready_items import MonitoredItem
from impactcell.opcua.subscriptions.subscription import Subscription
from impactcell.opcua.subscriptions.subscription_service import SubscriptionService


class MonitoredItemService:
    """Answers what clients ask of the items of their subscriptions."""

    def __init__(
        self,
        space: AddressSpace,
        values: VariableStore,
        access: AccessPolicy,
        limits: ServerLimits,
        subscriptions: SubscriptionService,
    ) -> None:
        self._space = space
        self._access = access
        self._values = values
        self._limits = limits
        self._subscriptions = subscriptions

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "CreateMonitoredItems": Service(ua.CreateMonitoredItemsParameters, self.create_monitored_items),
            "ModifyMonitoredItems": Service(ua.ModifyMonitoredItemsParameters, self.modify_monitored_items),
            "SetMonitoringMode": Service(ua.SetMonitoringModeParameters, self.set_monitoring_mode),
            "DeleteMonitoredItems": Service(ua.DeleteMonitoredItemsParameters, self.delete_monitored_items),
        }

    async def create_monitored_items(
        self, context: RequestContext, parameters: ua.CreateMonitoredItemsParameters
    ) -> ua.CreateMonitoredItemsResponse:
        """Add monitored items."""
        subscription = self._subscriptions.find(parameters.SubscriptionId, context.session)
        _check_timestamps(parameters.TimestampsToReturn)
        response = ua.CreateMonitoredItemsResponse()
        role, left = context.actor.role, self._subscriptions.room_for_items(subscription.owner)
        response.Results = await context.share.each(
            check_operations(parameters.ItemsToCreate),
            lambda item: self._create_result(subscription, item, parameters.TimestampsToReturn, role, left),
        )
        return response

    def _create_result(
        self,
        subscription: Subscription,
        request: ua.MonitoredItemCreateRequest,
        timestamps: ua.TimestampsToReturn,
        role: Role,
        room: ItemRoom,
    ) -> ua.MonitoredItemCreateResult:
        result = ua.MonitoredItemCreateResult()
        try:
            subscription.check_open()
            room.take(events=request.ItemToMonitor.AttributeId == ua.AttributeIds.EventNotifier)
            item = self._make_item(subscription, request, timestamps, role)
        except StatusCodeError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
            return result
        subscription.items[item.id] = item
        subscription.grant_queue(item)
        if item.waiting:
            subscription.ready(item)
        result.MonitoredItemId = item.id
        _revise_item(item, result)
        return result

    def _make_item(
        self,
        subscription: Subscription,
        request: ua.MonitoredItemCreateRequest,
        timestamps: ua.TimestampsToReturn,
        role: Role,
    ) -> MonitoredItem:
        target = request.ItemToMonitor
        node = self._space.get(target.NodeId)
        if node is None:
            raise StatusCodeError(ua.StatusCodes.BadNodeIdUnknown)
        if not self._access.permits(role, Permission.SUBSCRIBE, target.NodeId):
            raise StatusCodeError(ua.StatusCodes.BadUserAccessDenied)
        if target.AttributeId not in node.attributes:
            raise StatusCodeError(ua.StatusCodes.BadAttributeIdInvalid)
        if target.AttributeId == ua.AttributeIds.EventNotifier:
            item = EventMonitoredItem(
                subscription.next_item_id(), request, self._space, self._limits, subscription
            )
            self._subscriptions.listen(item, subscription)
            return item
        return DataMonitoredItem(
            subscription.next_item_id(),
            request,
            timestamps,
            self._space,
            self._values,
            self._limits,
            subscription,
        )

    async def modify_monitored_items(
        self, context: RequestContext, parameters: ua.ModifyMonitoredItemsParameters
    ) -> ua.ModifyMonitoredItemsResponse:
        """Change monitored items."""
        subscription = self._subscriptions.find(parameters.SubscriptionId, context.session)
        _check_timestamps(parameters.TimestampsToReturn)
        response = ua.ModifyMonitoredItemsResponse()

        def modify(change: ua.MonitoredItemModifyRequest) -> ua.MonitoredItemModifyResult:
            result = ua.MonitoredItemModifyResult()
            try:
                item = subscription.item(change.MonitoredItemId)
                before = item.revised[0]
                item.modify(change.RequestedParameters, parameters.TimestampsToReturn)
                subscription.grant_queue(item, before)
                _revise_item(item, result)
            except StatusCodeError as fault:
                result.StatusCode = ua.StatusCode(fault.code)
            return result

        response.Results = await context.share.each(check_operations(parameters.ItemsToModify), modify)
        return response

    async def set_monitoring_mode(
        self, context: RequestContext, parameters: ua.SetMonitoringModeParameters
    ) -> ua.SetMonitoringModeResponse:
        """Let items report, only sample, or rest."""
        subscription = self._subscriptions.find(parameters.SubscriptionId, context.session)
        response = ua.SetMonitoringModeResponse()
        response.Parameters.Results = await apply_to_each(
            context.share,
            parameters.MonitoredItemIds,
            lambda number: subscription.item(number).set_mode(parameters.MonitoringMode),
        )
        return response

    async def delete_monitored_items(
        self, context: RequestContext, parameters: ua.DeleteMonitoredItemsParameters
    ) -> ua.DeleteMonitoredItemsResponse:
        """Take monitored items out."""
        subscription = self._subscriptions.find(parameters.SubscriptionId, context.session)

        def delete(number: int) -> None:
            self._subscriptions.forget(subscription.item(number))
            subscription.remove(number)

        response = ua.DeleteMonitoredItemsResponse()
        response.Results = await apply_to_each(context.share, parameters.MonitoredItemIds, delete)
        return response


def _check_timestamps(timestamps: ua.TimestampsToReturn) -> None:
    if timestamps == ua.TimestampsToReturn.Invalid:
        raise StatusCodeError(ua.StatusCodes.BadTimestampsToReturnInvalid)


def _revise_item(item: MonitoredItem, result: Any) -> None:
    # 0: values are reported as they come, not sampled at an interval (Part 4, 5.13.1.2).
    result.RevisedSamplingInterval = 0.0
    result.RevisedQueueSize, filter_result = item.revised
    if filter_result is not None:
        result.FilterResult = filter_result
