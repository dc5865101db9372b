"""Browse, BrowseNext, TranslateBrowsePathsToNodeIds, RegisterNodes (Part 4, 5.9).

Mended: asyncua never limits an answer and has no BrowseNext, takes unknown reference types and directions,
and fails on an empty path.
"""

from dataclasses import dataclass, replace
from typing import Final

from asyncua import ua

from impactcell.opcua.address_space.node_references import HAS_SUBTYPE, targets
from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.continuation_points import MAX_BROWSE_POINTS, ContinuationPoints
from impactcell.opcua.languages import Languages
from impactcell.opcua.sessions.request_dispatch import RequestContext, Service, check_operations

MAX_REFERENCES_PER_NODE: Final = 1_000
"""References in one answer for a node; more come by continuation point."""
MAX_REFERENCES_PER_ANSWER: Final = 5_000
"""References of all nodes in one answer."""
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

    def __init__(self, space: AddressSpace, languages: Languages) -> None:
        self._space = space
        self._languages = languages
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
        answer, language = _Answer(context.session.browse_points), context.session.language
        response.Results = await context.share.each(
            (_UnfinishedBrowse(description, max_references) for description in descriptions),
            lambda unfinished: self._browse(unfinished, answer, language),
        )
        return response

    def _browse(
        self, unfinished: "_UnfinishedBrowse", answer: "_Answer", language: str | None
    ) -> ua.BrowseResult:
        try:
            result = answer.page(self._references(unfinished.description), unfinished)
        except StatusCodeError as fault:
            return ua.BrowseResult(StatusCode=ua.StatusCode(fault.code))
        mask = unfinished.description.ResultMask
        result.References = [self._as_asked(reference, mask, language) for reference in result.References]
        return result

    def _as_asked(
        self, reference: ua.ReferenceDescription, mask: int, language: str | None
    ) -> ua.ReferenceDescription:
        name = self._languages.text(reference.DisplayName, language)
        if name is not reference.DisplayName:
            reference = replace(reference, DisplayName=name)
        return masked(reference, mask)

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
            reference
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
        points, answer = context.session.browse_points, _Answer(context.session.browse_points)

        def go_on(point: bytes) -> ua.BrowseResult:
            try:
                unfinished = points.take(point)
            except StatusCodeError as fault:
                return ua.BrowseResult(StatusCode=ua.StatusCode(fault.code))
            if parameters.ReleaseContinuationPoints:
                return ua.BrowseResult()
            return self._browse(unfinished, answer, context.session.language)

        response = ua.BrowseNextResponse()
        response.Parameters.Results = await context.share.each(
            check_operations(parameters.ContinuationPoints), go_on
        )
        return response

    async def translate_browse_paths(
        self, context: RequestContext, parameters: ua.TranslateBrowsePathsToNodeIdsParameters
    ) -> ua.TranslateBrowsePathsToNodeIdsResponse:
        """Follow paths of browse names."""
        response = ua.TranslateBrowsePathsToNodeIdsResponse()
        response.Results = await context.share.each(check_operations(parameters.BrowsePaths), self._translate)
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


@dataclass(frozen=True, slots=True)
class _UnfinishedBrowse:
    """What a continuation point of Browse stands for: the question, and how far it has been answered."""

    description: ua.BrowseDescription
    max_references: int
    answered: int = 0


class _Answer:
    """One answer to Browse or BrowseNext: it has room for so many references of all nodes."""

    def __init__(self, points: ContinuationPoints) -> None:
        self._points = points
        self._kept = 0
        self._room = MAX_REFERENCES_PER_ANSWER

    def page(
        self, references: list[ua.ReferenceDescription], unfinished: _UnfinishedBrowse
    ) -> ua.BrowseResult:
        """Answer with as many references as fit, and keep where to go on.

        Raises
        ------
        StatusCodeError
            BadNoContinuationPoints: the answer is full, and so are the points that go on with it.
        """
        first = unfinished.answered
        last = min(len(references), first + min(unfinished.max_references, self._room))
        result = ua.BrowseResult()
        if last < len(references):
            # One that this answer has given already must not give way to the next.
            if self._kept == MAX_BROWSE_POINTS:
                raise StatusCodeError(ua.StatusCodes.BadNoContinuationPoints)
            self._kept += 1
            result.ContinuationPoint = self._points.keep(replace(unfinished, answered=last))
        result.References = references[first:last]
        self._room -= last - first
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
