"""MonitoredItem services (Part 4, 5.13)."""

from typing import Any

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import FaultError
from impactcell.opcua.host_interface import AccessPolicy, Permission, Role, ServerLimits
from impactcell.opcua.monitored_item import DataItem, EventItem
from impactcell.opcua.node_values import Values
from impactcell.opcua.request_dispatch import Context, Service, bounded
from impactcell.opcua.subscription import Item, Subscription
from impactcell.opcua.subscription_service import Monitoring, each


class MonitoredItems:
    """Answers what clients ask of the items of their subscriptions."""

    def __init__(
        self,
        space: AddressSpace,
        values: Values,
        access: AccessPolicy,
        limits: ServerLimits,
        monitoring: Monitoring,
    ) -> None:
        self._space = space
        self._access = access
        self._values = values
        self._limits = limits
        self._monitoring = monitoring

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "CreateMonitoredItems": Service(ua.CreateMonitoredItemsParameters, self.create_items),
            "ModifyMonitoredItems": Service(ua.ModifyMonitoredItemsParameters, self.modify_items),
            "SetMonitoringMode": Service(ua.SetMonitoringModeParameters, self.set_monitoring),
            "DeleteMonitoredItems": Service(ua.DeleteMonitoredItemsParameters, self.delete_items),
        }

    async def create_items(
        self, context: Context, wanted: ua.CreateMonitoredItemsParameters
    ) -> ua.CreateMonitoredItemsResponse:
        """Add monitored items."""
        found = self._monitoring.find(wanted.SubscriptionId, context.session)
        _check_timestamps(wanted.TimestampsToReturn)
        response = ua.CreateMonitoredItemsResponse()
        response.Results = [
            self._create_item(found, item, wanted.TimestampsToReturn, context.actor.role)
            for item in bounded(wanted.ItemsToCreate)
        ]
        return response

    def _create_item(
        self,
        found: Subscription,
        wanted: ua.MonitoredItemCreateRequest,
        timestamps: ua.TimestampsToReturn,
        role: Role,
    ) -> ua.MonitoredItemCreateResult:
        result = ua.MonitoredItemCreateResult()
        try:
            item = self._make_item(found, wanted, timestamps, role)
        except FaultError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
            return result
        found.items[item.id] = item
        if item.waiting:
            found.ready(item)
        result.MonitoredItemId = item.id
        _revise_item(item, result)
        return result

    def _make_item(
        self,
        found: Subscription,
        wanted: ua.MonitoredItemCreateRequest,
        timestamps: ua.TimestampsToReturn,
        role: Role,
    ) -> Item:
        target = wanted.ItemToMonitor
        node = self._space.get(target.NodeId)
        if node is None:
            raise FaultError(ua.StatusCodes.BadNodeIdUnknown)
        if not self._access.permits(role, Permission.SUBSCRIBE, target.NodeId):
            raise FaultError(ua.StatusCodes.BadUserAccessDenied)
        if target.AttributeId not in node.attributes:
            raise FaultError(ua.StatusCodes.BadAttributeIdInvalid)
        if target.AttributeId == ua.AttributeIds.EventNotifier:
            item = EventItem(found.next_item_id(), wanted, self._space, self._limits, found.ready)
            self._monitoring.listen(item, found)
            return item
        return DataItem(
            found.next_item_id(), wanted, timestamps, self._space, self._values, self._limits, found.ready
        )

    async def modify_items(
        self, context: Context, wanted: ua.ModifyMonitoredItemsParameters
    ) -> ua.ModifyMonitoredItemsResponse:
        """Change monitored items."""
        found = self._monitoring.find(wanted.SubscriptionId, context.session)
        _check_timestamps(wanted.TimestampsToReturn)
        response = ua.ModifyMonitoredItemsResponse()
        results = []
        for change in bounded(wanted.ItemsToModify):
            result = ua.MonitoredItemModifyResult()
            try:
                item = found.item(change.MonitoredItemId)
                item.modify(change.RequestedParameters, wanted.TimestampsToReturn)
                _revise_item(item, result)
            except FaultError as fault:
                result.StatusCode = ua.StatusCode(fault.code)
            results.append(result)
        response.Results = results
        return response

    async def set_monitoring(
        self, context: Context, wanted: ua.SetMonitoringModeParameters
    ) -> ua.SetMonitoringModeResponse:
        """Let items report, only sample, or rest."""
        found = self._monitoring.find(wanted.SubscriptionId, context.session)
        response = ua.SetMonitoringModeResponse()
        response.Parameters.Results = each(
            wanted.MonitoredItemIds, lambda number: found.item(number).set_mode(wanted.MonitoringMode)
        )
        return response

    async def delete_items(
        self, context: Context, wanted: ua.DeleteMonitoredItemsParameters
    ) -> ua.DeleteMonitoredItemsResponse:
        """Take monitored items out."""
        found = self._monitoring.find(wanted.SubscriptionId, context.session)

        def delete(number: int) -> None:
            self._monitoring.forget(found.item(number))
            found.remove(number)

        response = ua.DeleteMonitoredItemsResponse()
        response.Results = each(wanted.MonitoredItemIds, delete)
        return response


def _check_timestamps(timestamps: ua.TimestampsToReturn) -> None:
    if timestamps == ua.TimestampsToReturn.Invalid:
        raise FaultError(ua.StatusCodes.BadTimestampsToReturnInvalid)


def _revise_item(item: Item, result: Any) -> None:
    # 0: values are reported as they come, not sampled at an interval (Part 4, 5.13.1.2).
    result.RevisedSamplingInterval = 0.0
    result.RevisedQueueSize, filter_result = item.revised
    if filter_result is not None:
        result.FilterResult = filter_result
