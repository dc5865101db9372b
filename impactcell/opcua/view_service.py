"""Browse, BrowseNext, TranslateBrowsePathsToNodeIds, RegisterNodes (Part 4, 5.9).

Mended: asyncua never limits an answer and has no BrowseNext, takes unknown reference types and directions,
and fails on an empty path.
"""

from typing import Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.request_dispatch import RequestContext, Service, check_operations
from impactcell.opcua.session_table import ContinuationPoints
from impactcell.opcua.type_instances import HAS_SUBTYPE, targets

MAX_REFERENCES_PER_NODE: Final = 1_000
"""References in one answer for a node; more come by continuation point."""
MAX_PATH_ELEMENTS: Final = 50
"""Elements of one browse path."""
NO_REMAINING_PATH: Final = 2**32 - 1
"""RemainingPathIndex of a path that was followed to its end (Part 4, 5.9.4)."""
DIRECTIONS: Final = {
    ua.BrowseDirection.Forward: (True,),
    ua.BrowseDirection.Inverse: (False,),
    ua.BrowseDirection.Both: (True, False),
}


class ViewService:
    """Answers what clients ask of the shape of the address space."""

    def __init__(self, space: AddressSpace) -> None:
        self._space = space
        self._subtypes: dict[ua.NodeId, frozenset[ua.NodeId]] = {}

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "Browse": Service(ua.BrowseParameters, self.browse),
            "BrowseNext": Service(ua.BrowseNextParameters, self.browse_next),
            "TranslateBrowsePathsToNodeIds": Service(
                ua.TranslateBrowsePathsToNodeIdsParameters, self.translate_browse_paths
            ),
            "RegisterNodes": Service(ua.RegisterNodesParameters, self.register_nodes),
            "UnregisterNodes": Service(ua.UnregisterNodesParameters, self.unregister_nodes),
        }

    async def browse(self, context: RequestContext, parameters: ua.BrowseParameters) -> ua.BrowseResponse:
        """Follow references from nodes."""
        descriptions = check_operations(parameters.NodesToBrowse)
        if not parameters.View.ViewId.is_null():
            raise StatusCodeError(ua.StatusCodes.BadViewIdUnknown)
        max_references = min(
            parameters.RequestedMaxReferencesPerNode or MAX_REFERENCES_PER_NODE, MAX_REFERENCES_PER_NODE
        )
        response = ua.BrowseResponse()
        response.Results = [
            self._browse(description, max_references, context.session.browse) for description in descriptions
        ]
        return response

    def _browse(
        self, description: ua.BrowseDescription, max_references: int, continuation_points: ContinuationPoints
    ) -> ua.BrowseResult:
        result = ua.BrowseResult()
        try:
            references = self._references(description)
        except StatusCodeError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
            return result
        return page(references, max_references, continuation_points)

    def _references(self, description: ua.BrowseDescription) -> list[ua.ReferenceDescription]:
        node = self._space.get(description.NodeId)
        if node is None:
            raise StatusCodeError(ua.StatusCodes.BadNodeIdUnknown)
        directions = DIRECTIONS.get(description.BrowseDirection)
        if directions is None:
            raise StatusCodeError(ua.StatusCodes.BadBrowseDirectionInvalid)
        reference_types = self._reference_types(
            description.ReferenceTypeId, subtypes=description.IncludeSubtypes
        )
        return [
            masked(reference, description.ResultMask)
            for reference in node.references
            if reference.IsForward in directions
            and (reference_types is None or reference.ReferenceTypeId in reference_types)
            and (not description.NodeClassMask or description.NodeClassMask & reference.NodeClass)
        ]

    def _reference_types(self, reference_type: ua.NodeId, *, subtypes: bool) -> frozenset[ua.NodeId] | None:
        if reference_type.is_null():
            return None
        node = self._space.get(reference_type)
        node_class = (
            node.attributes[ua.AttributeIds.NodeClass].value.Value.Value if node is not None else None
        )
        if node_class != ua.NodeClass.ReferenceType:
            raise StatusCodeError(ua.StatusCodes.BadReferenceTypeIdInvalid)
        return self._with_subtypes(reference_type) if subtypes else frozenset({reference_type})

    def _with_subtypes(self, reference_type: ua.NodeId) -> frozenset[ua.NodeId]:
        with_subtypes = self._subtypes.get(reference_type)
        if with_subtypes is None:
            below = [
                self._with_subtypes(subtype) for subtype in targets(self._space[reference_type], HAS_SUBTYPE)
            ]
            with_subtypes = self._subtypes[reference_type] = frozenset({reference_type}).union(*below)
        return with_subtypes

    async def browse_next(
        self, context: RequestContext, parameters: ua.BrowseNextParameters
    ) -> ua.BrowseNextResponse:
        """Go on where an answer was cut, or release what was kept for it."""
        response = ua.BrowseNextResponse()
        results = []
        for point in check_operations(parameters.ContinuationPoints):
            result = ua.BrowseResult()
            try:
                references, max_references = context.session.browse.take(point)
                if not parameters.ReleaseContinuationPoints:
                    result = page(references, max_references, context.session.browse)
            except StatusCodeError as fault:
                result.StatusCode = ua.StatusCode(fault.code)
            results.append(result)
        response.Parameters.Results = results
        return response

    async def translate_browse_paths(
        self, _context: RequestContext, parameters: ua.TranslateBrowsePathsToNodeIdsParameters
    ) -> ua.TranslateBrowsePathsToNodeIdsResponse:
        """Follow paths of browse names."""
        response = ua.TranslateBrowsePathsToNodeIdsResponse()
        response.Results = [self._translate(path) for path in check_operations(parameters.BrowsePaths)]
        return response

    def _translate(self, path: ua.BrowsePath) -> ua.BrowsePathResult:
        result = ua.BrowsePathResult()
        try:
            nodes = self.follow(path)
        except StatusCodeError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
            return result
        result.Targets = [
            ua.BrowsePathTarget(
                TargetId=ua.ExpandedNodeId(node.Identifier, node.NamespaceIndex, node.NodeIdType),
                RemainingPathIndex=NO_REMAINING_PATH,
            )
            for node in nodes
        ]
        return result

    def follow(self, path: ua.BrowsePath) -> list[ua.NodeId]:
        """Follow one path of browse names to all nodes that it leads to.

        Raises
        ------
        StatusCodeError
            BadNoMatch, or that of a path that is none.
        """
        elements = path.RelativePath.Elements
        if path.StartingNode not in self._space:
            raise StatusCodeError(ua.StatusCodes.BadNodeIdUnknown)
        if not elements:
            raise StatusCodeError(ua.StatusCodes.BadNothingToDo)
        if len(elements) > MAX_PATH_ELEMENTS:
            raise StatusCodeError(ua.StatusCodes.BadTooManyOperations)
        nodes = [path.StartingNode]
        for element in elements:
            if not element.TargetName.Name:
                raise StatusCodeError(ua.StatusCodes.BadBrowseNameInvalid)
            reference_types = self._reference_types(element.ReferenceTypeId, subtypes=element.IncludeSubtypes)
            # Each node once: where many ways lead to one, following each would take their product.
            nodes = list(
                dict.fromkeys(
                    reference.NodeId
                    for node in nodes
                    if (data := self._space.get(node)) is not None
                    for reference in data.references
                    if reference.BrowseName == element.TargetName
                    and reference.IsForward != element.IsInverse
                    and (reference_types is None or reference.ReferenceTypeId in reference_types)
                )
            )
        if not nodes:
            raise StatusCodeError(ua.StatusCodes.BadNoMatch)
        return nodes

    async def register_nodes(
        self, _context: RequestContext, parameters: ua.RegisterNodesParameters
    ) -> ua.RegisterNodesResponse:
        """Take nodes a client will use often; their NodeIds are as quick as any."""
        response = ua.RegisterNodesResponse()
        response.Parameters.RegisteredNodeIds = check_operations(parameters.NodesToRegister)
        return response

    async def unregister_nodes(
        self, _context: RequestContext, parameters: ua.UnregisterNodesParameters
    ) -> ua.UnregisterNodesResponse:
        """Forget registered nodes."""
        check_operations(parameters.NodesToUnregister)
        return ua.UnregisterNodesResponse()


def page(
    references: list[ua.ReferenceDescription], max_references: int, continuation_points: ContinuationPoints
) -> ua.BrowseResult:
    """Answer with as many references as fit, and keep the rest."""
    result = ua.BrowseResult()
    result.References = references[:max_references]
    if len(references) > max_references:
        result.ContinuationPoint = continuation_points.keep((references[max_references:], max_references))
    return result


def masked(reference: ua.ReferenceDescription, mask: int) -> ua.ReferenceDescription:
    """Copy a reference with the fields that were asked for."""
    bits = ua.BrowseResultMask
    if mask & bits.All == bits.All:
        return reference
    empty = ua.ReferenceDescription()
    return ua.ReferenceDescription(
        ReferenceTypeId=reference.ReferenceTypeId if mask & bits.ReferenceTypeId else empty.ReferenceTypeId,
        IsForward=reference.IsForward if mask & bits.IsForward else empty.IsForward,
        NodeId=reference.NodeId,
        BrowseName=reference.BrowseName if mask & bits.BrowseName else empty.BrowseName,
        DisplayName=reference.DisplayName if mask & bits.DisplayName else empty.DisplayName,
        NodeClass=reference.NodeClass if mask & bits.NodeClass else empty.NodeClass,
        TypeDefinition=reference.TypeDefinition if mask & bits.TypeDefinition else empty.TypeDefinition,
    )
