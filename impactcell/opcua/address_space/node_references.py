"""What a node says of itself and of others: its attributes and references, read and written in place."""

from collections.abc import Iterator
from typing import Any

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace, AttributeValue, NodeData

HAS_SUBTYPE = ua.NodeId(ua.ObjectIds.HasSubtype)
HAS_TYPE_DEFINITION = ua.NodeId(ua.ObjectIds.HasTypeDefinition)


def read_attribute(space: AddressSpace, node: ua.NodeId, attribute: ua.AttributeIds) -> Any:
    """Value of an attribute, None where the node has none."""
    data = space.read_attribute_value(node, attribute)
    return data.Value.Value if data.Value is not None else None


def targets(node: NodeData, reference: ua.NodeId, *, forward: bool = True) -> list[ua.NodeId]:
    """Nodes that a node refers to."""
    return [r.NodeId for r in node.references if r.ReferenceTypeId == reference and r.IsForward == forward]


def supertypes(space: AddressSpace, node: ua.NodeId) -> Iterator[ua.NodeId]:
    """Walk from a type to all it is derived from, nearest first."""
    current: ua.NodeId | None = node
    while current is not None:
        yield current
        data = space.get(current)
        parents = targets(data, HAS_SUBTYPE, forward=False) if data is not None else []
        current = parents[0] if parents else None


def link(space: AddressSpace, source: ua.NodeId, reference: ua.NodeId, target: ua.NodeId) -> None:
    """Add a reference in both directions, once; a type is not told of its instances."""
    directions = ((source, target, True), (target, source, False))
    for start, end, forward in directions[: 1 if reference == HAS_TYPE_DEFINITION else 2]:
        data = space[start]
        if any(r.NodeId == end and r.ReferenceTypeId == reference for r in data.references):
            continue
        types = targets(space[end], HAS_TYPE_DEFINITION)
        data.references.append(
            ua.ReferenceDescription(
                ReferenceTypeId=reference,
                IsForward=forward,
                NodeId=end,
                BrowseName=read_attribute(space, end, ua.AttributeIds.BrowseName),
                DisplayName=read_attribute(space, end, ua.AttributeIds.DisplayName),
                NodeClass=read_attribute(space, end, ua.AttributeIds.NodeClass),
                TypeDefinition=types[0] if types else ua.NodeId(),
            )
        )


def set_attribute(
    space: AddressSpace,
    node: ua.NodeId,
    attribute: ua.AttributeIds,
    value: object,
    variant_type: ua.VariantType,
) -> None:
    """Write an attribute in place, whatever it held before."""
    space[node].attributes[attribute] = AttributeValue(ua.DataValue(ua.Variant(value, variant_type)))
