"""Objects made from the types of the address space, with NodeIds that stay the same over restarts.

asyncua instantiates a type with numbered NodeIds that depend on the order of creation, and without the
descriptions. Here the NodeId of a node is its path from the cell: `press-1/Wear/Level`.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace, AttributeValue, NodeData

AGGREGATE_REFERENCES = frozenset(
    ua.NodeId(i)
    for i in (
        ua.ObjectIds.HasComponent,
        ua.ObjectIds.HasProperty,
        ua.ObjectIds.HasOrderedComponent,
        ua.ObjectIds.HasAddIn,
    )
)
HAS_SUBTYPE = ua.NodeId(ua.ObjectIds.HasSubtype)
HAS_TYPE_DEFINITION = ua.NodeId(ua.ObjectIds.HasTypeDefinition)
HAS_MODELLING_RULE = ua.NodeId(ua.ObjectIds.HasModellingRule)
MANDATORY = ua.NodeId(ua.ObjectIds.ModellingRule_Mandatory)

OptionalNodes = Callable[[str], bool]
"""Whether an optional node, named by its path below the instance, is wanted."""


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


def instantiate(
    space: AddressSpace,
    type_definition: ua.NodeId,
    node: ua.NodeId,
    browse_name: ua.QualifiedName,
    description: str,
    descriptions: Mapping[str, str],
    is_wanted: OptionalNodes = lambda _path: False,
) -> None:
    """Make an object of a type: all mandatory nodes, and the optional ones that are `wanted`.

    `descriptions`, by browse name, are for nodes below it whose declarations have none.
    """
    data = NodeData(node)
    space[node] = data
    attributes: tuple[tuple[ua.AttributeIds, object, ua.VariantType], ...] = (
        (ua.AttributeIds.NodeId, node, ua.VariantType.NodeId),
        (ua.AttributeIds.NodeClass, ua.NodeClass.Object, ua.VariantType.Int32),
        (ua.AttributeIds.BrowseName, browse_name, ua.VariantType.QualifiedName),
        (ua.AttributeIds.DisplayName, ua.LocalizedText(browse_name.Name), ua.VariantType.LocalizedText),
        (ua.AttributeIds.Description, ua.LocalizedText(description), ua.VariantType.LocalizedText),
        (ua.AttributeIds.EventNotifier, 0, ua.VariantType.Byte),
        (ua.AttributeIds.WriteMask, 0, ua.VariantType.UInt32),
        (ua.AttributeIds.UserWriteMask, 0, ua.VariantType.UInt32),
    )
    for attribute, value, variant in attributes:
        set_attribute(space, node, attribute, value, variant)
    link(space, node, HAS_TYPE_DEFINITION, type_definition)
    _fill(space, node, _declarations(space, [type_definition]), descriptions, is_wanted, "")


def _declarations(
    space: AddressSpace, sources: list[ua.NodeId]
) -> dict[tuple[int, str], tuple[ua.NodeId, ua.NodeId]]:
    """Instance declarations of nodes and of their types: browse name to (declaration, reference type)."""
    declarations: dict[tuple[int, str], tuple[ua.NodeId, ua.NodeId]] = {}
    for source in sources:
        for type_definition in supertypes(space, source):
            for reference in space[type_definition].references:
                if reference.IsForward and reference.ReferenceTypeId in AGGREGATE_REFERENCES:
                    name = reference.BrowseName
                    declarations.setdefault(
                        (name.NamespaceIndex, name.Name), (reference.NodeId, reference.ReferenceTypeId)
                    )
    return declarations


def _fill(
    space: AddressSpace,
    parent: ua.NodeId,
    declarations: dict[tuple[int, str], tuple[ua.NodeId, ua.NodeId]],
    descriptions: Mapping[str, str],
    is_wanted: OptionalNodes,
    below: str,
) -> None:
    for (_, name), (declaration, reference) in declarations.items():
        original = space[declaration]
        rules = targets(original, HAS_MODELLING_RULE)
        path = f"{below}{name}"
        if not rules or (rules[0] != MANDATORY and not is_wanted(path)):
            continue
        node = ua.NodeId(f"{parent.Identifier}/{name}", parent.NamespaceIndex)
        copy = NodeData(node)
        for attribute, attribute_value in original.attributes.items():
            copy.attributes[attribute] = AttributeValue(attribute_value.value)
        space[node] = copy
        set_attribute(space, node, ua.AttributeIds.NodeId, node, ua.VariantType.NodeId)
        _describe(space, node, descriptions.get(name))
        types = targets(original, HAS_TYPE_DEFINITION)
        for type_definition in types:
            link(space, node, HAS_TYPE_DEFINITION, type_definition)
        link(space, parent, reference, node)
        _fill(space, node, _declarations(space, [declaration, *types]), descriptions, is_wanted, f"{path}/")


def _describe(space: AddressSpace, node: ua.NodeId, text: str | None) -> None:
    description = read_attribute(space, node, ua.AttributeIds.Description)
    if (description is None or not description.Text) and text is not None:
        value = ua.LocalizedText(text)
        set_attribute(space, node, ua.AttributeIds.Description, value, ua.VariantType.LocalizedText)
