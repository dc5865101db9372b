"""Objects made from the types of the address space, with NodeIds that stay the same over restarts.

asyncua instantiates a type with numbered NodeIds that depend on the order of creation, and without the
descriptions. Here the NodeId of a node is its path from the cell: `press-1/Wear/Level`.
"""

from collections.abc import Callable, Mapping

from asyncua import ua

from impactcell.opcua.address_space.node_references import (
    HAS_TYPE_DEFINITION,
    link,
    read_attribute,
    set_attribute,
    supertypes,
    targets,
)
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
HAS_MODELLING_RULE = ua.NodeId(ua.ObjectIds.HasModellingRule)
MANDATORY = ua.NodeId(ua.ObjectIds.ModellingRule_Mandatory)

OptionalNodes = Callable[[str], bool]
"""Whether an optional node, named by its path below the instance, is wanted."""


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
