"""Requests of OPC UA that no client should send: well encoded, and with odd values in every field."""

import dataclasses
import enum
import math
import random
import types
import typing
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from typing import Any
from uuid import UUID

from asyncua import ua

DEEPEST = 8
"""Structures within structures that are filled."""
LEFT_ALONE = frozenset({"TypeId", "RequestHeader", "Encoding", "data_type"})
"""Fields that say what the message is."""
SHARE_OF_KNOWN = 0.8
"""How often an identifier is one that the server has given, or a node that it has."""
SERVICES = [
    "Read",
    "Write",
    "Call",
    "HistoryRead",
    "HistoryUpdate",
    "Browse",
    "BrowseNext",
    "TranslateBrowsePathsToNodeIds",
    "RegisterNodes",
    "UnregisterNodes",
    "CreateSubscription",
    "ModifySubscription",
    "SetPublishingMode",
    "CreateMonitoredItems",
    "ModifyMonitoredItems",
    "SetMonitoringMode",
    "SetTriggering",
    "DeleteMonitoredItems",
    "DeleteSubscriptions",
    "Republish",
    "TransferSubscriptions",
    "AddNodes",
    "DeleteNodes",
    "AddReferences",
    "QueryFirst",
    "QueryNext",
    "Cancel",
    "FindServers",
    "GetEndpoints",
    "FindServersOnNetwork",
    "RegisterServer",
]
"""All that is answered at once, within a session."""
FLOATS = (0.0, -1.0, 1.0, 1e308, -1e-308, 100.0, 3.6e6, math.nan, math.inf, -math.inf)
INTEGERS = (0, 1, 2, 5, 7, 13, 85, 100, 255, 1000, 65535, 2**31 - 1)
TEXTS = (
    None, "", "a", "\0", "no\nline", "ä" * 100, "x" * 5000, "<script>", "0:1", "1:0", "0:99999999", "-1",
    "1:2,3", "de", "xx-YY", "%_%_%_%", "[", "Objects",
)  # fmt: skip
BYTES = (None, b"", b"\0", b"y" * 300)
TIMES = tuple(datetime(year, 1, 1, tzinfo=UTC) for year in (1601, 1970, 2026, 9999))
OTHER_NODES = (
    *(ua.NodeId(number) for number in (0, 33, 45, 84, 85, 2041, 2253, 2782, 3875, 9029, 9111, 11492, 12873)),
    ua.NodeId("nobody's", 2), ua.NodeId("x" * 4000, 3), ua.NodeId(b"\0\xff", 2), ua.NodeId(1, 255),
    ua.NodeId(UUID(int=7), 2),
)  # fmt: skip
EXTENSIONS: dict[str, tuple[type, ...]] = {
    "HistoryReadDetails": (
        ua.ReadRawModifiedDetails, ua.ReadProcessedDetails, ua.ReadAtTimeDetails, ua.ReadEventDetails,
    ),
    "Filter": (ua.DataChangeFilter, ua.EventFilter, ua.AggregateFilter),
    "FilterOperands": (
        ua.LiteralOperand, ua.SimpleAttributeOperand, ua.ElementOperand, ua.AttributeOperand,
    ),
}  # fmt: skip
"""Structures that belong into a field."""
ANY_EXTENSION = (ua.Argument, ua.Range, ua.AnonymousIdentityToken, *sum(EXTENSIONS.values(), ()))
"""Structures that belong nowhere, or elsewhere."""


class OddRequests:
    """Makes requests at random; what the server gave is used again.

    Parameters
    ----------
    nodes : sequence of NodeId
        Nodes that the server has.
    methods : sequence of (NodeId, NodeId)
        Objects and their methods.
    """

    def __init__(
        self, seed: int, nodes: Sequence[ua.NodeId], methods: Sequence[tuple[ua.NodeId, ua.NodeId]]
    ) -> None:
        self.rng = random.Random(seed)
        self.nodes, self.methods = tuple(nodes), tuple(methods)
        self.given: dict[str, list[Any]] = {"subscription": [], "item": [], "point": []}

    def request(self) -> Any:
        """Make a request of any service."""
        made = self._structure(getattr(ua, f"{self.rng.choice(SERVICES)}Request"), 0)
        if isinstance(made, ua.CallRequest):
            for call in made.Parameters.MethodsToCall or ():
                if self.rng.random() < SHARE_OF_KNOWN:
                    call.ObjectId, call.MethodId = self.rng.choice(self.methods)
        if isinstance(made, ua.CreateMonitoredItemsRequest):
            self._make_likely(made.Parameters)
        return made

    def _make_likely(self, parameters: Any) -> None:
        """Have items that the server takes, often enough."""
        if self.given["subscription"]:
            parameters.SubscriptionId = self.rng.choice(self.given["subscription"])
        parameters.TimestampsToReturn = ua.TimestampsToReturn.Both
        for item in parameters.ItemsToCreate or ():
            item.ItemToMonitor.IndexRange, item.ItemToMonitor.DataEncoding = None, ua.QualifiedName()
            if self.rng.random() < SHARE_OF_KNOWN:
                item.ItemToMonitor.NodeId = self.rng.choice(self.nodes)
                item.RequestedParameters.Filter = None

    def answered(self, answer: Any) -> None:
        """Keep what an answer gives."""
        parameters = getattr(answer, "Parameters", None)
        if isinstance(answer, ua.CreateSubscriptionResponse):
            self.given["subscription"].append(parameters.SubscriptionId)
        for result in getattr(answer, "Results", None) or getattr(parameters, "Results", None) or ():
            if getattr(result, "MonitoredItemId", 0):
                self.given["item"].append(result.MonitoredItemId)
            if getattr(result, "ContinuationPoint", None):
                self.given["point"].append(result.ContinuationPoint)

    def _structure(self, kind: type, depth: int) -> Any:
        made = kind()
        for name, field in _fields(kind).items():
            if name not in LEFT_ALONE and self.rng.random() > 0.1:
                setattr(made, name, self._value(field, depth, name))
        return made

    def _value(self, kind: Any, depth: int, name: str) -> Any:
        choose = self.rng.choice
        origin = typing.get_origin(kind)
        if origin in {typing.Union, types.UnionType}:
            kind = next(item for item in typing.get_args(kind) if item is not type(None))
            return self._value(kind, depth, name)
        if origin is list:
            count = choose((0, 1, 1, 2, 3)) if depth < DEEPEST else 0
            return [self._value(typing.get_args(kind)[0], depth + 1, name) for _ in range(count)]
        known = self._known(name) if issubclass(kind, (int, bytes)) else ()
        if known and self.rng.random() < SHARE_OF_KNOWN:
            return choose(known)
        if issubclass(kind, enum.Enum):
            return choose(list(kind))
        plain = self._plain(kind)
        if plain is not None:
            return choose(plain)
        if kind is ua.ExtensionObject or kind is object:
            of_field = EXTENSIONS.get(name, ANY_EXTENSION)
            wanted = of_field if self.rng.random() < SHARE_OF_KNOWN else ANY_EXTENSION
            return self._structure(choose(wanted), depth + 1) if depth < DEEPEST else None
        if dataclasses.is_dataclass(kind):
            return self._structure(kind, depth + 1) if depth < DEEPEST else kind()
        return None

    def _known(self, name: str) -> Sequence[Any]:
        """What the server has given for a field."""
        if name == "AttributeId":
            return ua.AttributeIds.Value, ua.AttributeIds.Value, ua.AttributeIds.EventNotifier, 1, 4, 99
        kinds = {"Subscription": "subscription", "Item": "item", "ContinuationPoint": "point"}
        return next((self.given[kind] for part, kind in kinds.items() if part in name), ())[-20:]

    def _plain(self, kind: type) -> Sequence[Any] | None:
        """Values of a type that is no structure."""
        rng = self.rng
        if kind is ua.NodeId:
            return self.nodes if rng.random() < SHARE_OF_KNOWN else OTHER_NODES
        if kind is ua.ExpandedNodeId:
            return [ua.ExpandedNodeId(number, 0) for number in (1, 85, 2041)]
        if kind is ua.Variant:
            return [self._variant()]
        if kind is ua.DataValue:
            return [ua.DataValue(self._variant(), rng.choice((None, ua.StatusCode(0))), rng.choice(TIMES))]
        if kind is ua.LocalizedText:
            return [ua.LocalizedText(rng.choice(TEXTS), rng.choice(TEXTS))]
        if kind is ua.QualifiedName:
            return [ua.QualifiedName(rng.choice(TEXTS[1:]), rng.choice((0, 1, 2, 99)))]
        if kind is ua.StatusCode:
            return [ua.StatusCode(0), ua.StatusCode(0x80000000)]
        if issubclass(kind, datetime):
            return TIMES
        for base, values in ((bool, (False, True)), (float, FLOATS), (str, TEXTS), (bytes, BYTES)):
            if issubclass(kind, base) or kind.__name__ == base.__name__.capitalize():
                return values
        if issubclass(kind, int):
            largest = {"Byte": 255, "SByte": 127, "UInt16": 65535, "Int16": 32767}.get(
                kind.__name__, 2**31 - 1
            )
            return [min(value, largest) for value in INTEGERS]
        return None

    def _variant(self) -> ua.Variant:
        kinds: dict[ua.VariantType, Sequence[Any]] = {
            ua.VariantType.Double: FLOATS, ua.VariantType.Int32: (0, -1, 2**31 - 1),
            ua.VariantType.UInt32: INTEGERS, ua.VariantType.Boolean: (False, True),
            ua.VariantType.String: TEXTS, ua.VariantType.ByteString: BYTES, ua.VariantType.DateTime: TIMES,
            ua.VariantType.NodeId: (*self.nodes, *OTHER_NODES),
            ua.VariantType.LocalizedText: [ua.LocalizedText(text) for text in TEXTS],
            ua.VariantType.StatusCode: (ua.StatusCode(0), ua.StatusCode(0x40000000)),
        }  # fmt: skip
        kind = self.rng.choice(tuple(kinds))
        if self.rng.random() < 0.1:
            return ua.Variant()
        if self.rng.random() < 0.2:
            count = self.rng.choice((0, 1, 4))
            return ua.Variant([self.rng.choice(kinds[kind]) for _ in range(count)], kind, is_array=True)
        return ua.Variant(self.rng.choice(kinds[kind]), kind)


@cache
def _fields(kind: type) -> dict[str, Any]:
    """Fields of a structure of asyncua with their types, which it writes as text, twice quoted."""
    names = {**vars(typing), **{name: getattr(ua, name) for name in dir(ua)}, "ua": ua}
    found = {}
    for base in reversed(kind.__mro__):
        for name, field in getattr(base, "__annotations__", {}).items():
            while isinstance(field, str):
                field = eval(field, names)
            found[name] = field
    return found
