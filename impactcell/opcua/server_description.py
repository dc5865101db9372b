"""What the server tells of itself: what it is, and the limits that hold (Part 5, 6.3)."""

from datetime import datetime
from typing import Any

from asyncua import ua

from impactcell.opcua.binary_codec import MAX_OPERATIONS
from impactcell.opcua.continuation_points import MAX_BROWSE_POINTS, MAX_HISTORY_POINTS
from impactcell.opcua.history.historical_variable import BEGINNING, VALUES_PER_PAGE
from impactcell.opcua.history.history_service import MAX_NODES_PER_READ
from impactcell.opcua.host_interface import Product, ServerSettings


def build_info(product: Product) -> ua.BuildInfo:
    """Tell which program it is; when it was built is not given, as a package of Python does not know it."""
    info = ua.BuildInfo()
    info.ProductUri = product.uri
    info.ManufacturerName = product.name
    info.ProductName = product.name
    info.SoftwareVersion = product.version
    info.BuildNumber = product.version
    info.BuildDate = BEGINNING
    return info


def server_description(
    settings: ServerSettings, product: Product, locales: list[str], started: datetime
) -> list[tuple[int, Any, ua.VariantType]]:
    """List what stands in the nodes of the server, as numbers of their NodeIds, values and types.

    The most monitored items are those of one user, who asks. No profile is claimed: none has been certified.
    """
    ids, kinds, limits = ua.ObjectIds, ua.VariantType, settings.limits
    return [
        (ids.Server_ServerArray, [settings.application_uri], kinds.String),
        (ids.Server_ServiceLevel, 255, kinds.Byte),
        (ids.Server_ServerCapabilities_LocaleIdArray, locales, kinds.String),
        (ids.Server_Auditing, False, kinds.Boolean),
        (ids.Server_ServerStatus_StartTime, started, kinds.DateTime),
        (ids.Server_ServerStatus_State, int(ua.ServerState.Running), kinds.Int32),
        (ids.Server_ServerStatus_BuildInfo, build_info(product), kinds.ExtensionObject),
        (ids.Server_ServerStatus_BuildInfo_ProductUri, product.uri, kinds.String),
        (ids.Server_ServerStatus_BuildInfo_ProductName, product.name, kinds.String),
        (ids.Server_ServerStatus_BuildInfo_ManufacturerName, product.name, kinds.String),
        (ids.Server_ServerStatus_BuildInfo_SoftwareVersion, product.version, kinds.String),
        (ids.Server_ServerStatus_BuildInfo_BuildNumber, product.version, kinds.String),
        (ids.Server_ServerStatus_BuildInfo_BuildDate, BEGINNING, kinds.DateTime),
        (ids.Server_ServerCapabilities_MaxBrowseContinuationPoints, MAX_BROWSE_POINTS, kinds.UInt16),
        (
            ids.Server_ServerCapabilities_MaxHistoryContinuationPoints,
            MAX_HISTORY_POINTS,
            kinds.UInt16,
        ),
        (ids.Server_ServerCapabilities_MaxQueryContinuationPoints, 0, kinds.UInt16),
        (ids.Server_ServerCapabilities_MaxSessions, limits.sessions, kinds.UInt32),
        (ids.Server_ServerCapabilities_MaxSubscriptions, limits.subscriptions, kinds.UInt32),
        (
            ids.Server_ServerCapabilities_MaxSubscriptionsPerSession,
            limits.subscriptions_per_session,
            kinds.UInt32,
        ),
        (ids.Server_ServerCapabilities_MaxMonitoredItems, limits.items_per_user, kinds.UInt32),
        (
            ids.Server_ServerCapabilities_MaxMonitoredItemsPerSubscription,
            limits.items_per_subscription,
            kinds.UInt32,
        ),
        (ids.Server_ServerCapabilities_MaxMonitoredItemsQueueSize, limits.queue_per_item, kinds.UInt32),
        (ids.Server_ServerCapabilities_ServerProfileArray, [], kinds.String),
        (
            ids.Server_ServerCapabilities_MinSupportedSampleRate,
            limits.publishing_interval_s * 1e3,
            kinds.Double,
        ),
        (
            ids.Server_ServerCapabilities_OperationLimits_MaxNodesPerHistoryReadData,
            MAX_NODES_PER_READ,
            kinds.UInt32,
        ),
        (ids.Server_ServerCapabilities_OperationLimits_MaxNodesPerRead, MAX_OPERATIONS, kinds.UInt32),
        (ids.HistoryServerCapabilities_AccessHistoryDataCapability, True, kinds.Boolean),
        (ids.HistoryServerCapabilities_AccessHistoryEventsCapability, True, kinds.Boolean),
        (ids.HistoryServerCapabilities_MaxReturnDataValues, VALUES_PER_PAGE, kinds.UInt32),
        (ids.HistoryServerCapabilities_MaxReturnEventValues, VALUES_PER_PAGE, kinds.UInt32),
    ]
