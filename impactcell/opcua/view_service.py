"""Browse, BrowseNext, TranslateBrowsePathsToNodeIds, RegisterNodes (Part 4, 5.9).

Mended: asyncua never limits an answer and has no BrowseNext, takes unknown reference types and directions,
and fails on an empty path.
"""

from typing import Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import FaultError
from impactcell.opcua.request_dispatch import Context, Service, bounded
from impactcell.opcua.sessions import Continuations
from impactcell.opcua.type_instances import HAS_SUBTYPE, targets

MOST_REFERENCES: Final = 1_000
MAX_PATH: Final = 50
WHOLE_PATH: Final = 2**32 - 1
DIRECTIONS: Final = {
    ua.BrowseDirection.Forward: (True,),
    ua.BrowseDirection.Inverse: (False,),
    ua.BrowseDirection.Both: (True, False),
}


class Views:
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
                ua.TranslateBrowsePathsToNodeIdsParameters, self.translate
            ),
            "RegisterNodes": Service(ua.RegisterNodesParameters, self.register),
            "UnregisterNodes": Service(ua.UnregisterNodesParameters, self.unregister),
        }

    async def browse(self, context: Context, wanted: ua.BrowseParameters) -> ua.BrowseResponse:
        """Follow references from nodes."""
        nodes = bounded(wanted.NodesToBrowse)
        if not wanted.View.ViewId.is_null():
            raise FaultError(ua.StatusCodes.BadViewIdUnknown)
        most = min(wanted.RequestedMaxReferencesPerNode or MOST_REFERENCES, MOST_REFERENCES)
        response = ua.BrowseResponse()
        response.Results = [self._browse(node, most, context.session.browse) for node in nodes]
        return response

    def _browse(self, wanted: ua.BrowseDescription, most: int, kept: Continuations) -> ua.BrowseResult:
        result = ua.BrowseResult()
        try:
            found = self._references(wanted)
        except FaultError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
            return result
        return page(found, most, kept)

    def _references(self, wanted: ua.BrowseDescription) -> list[ua.ReferenceDescription]:
        node = self._space.get(wanted.NodeId)
        if node is None:
            raise FaultError(ua.StatusCodes.BadNodeIdUnknown)
        directions = DIRECTIONS.get(wanted.BrowseDirection)
        if directions is None:
            raise FaultError(ua.StatusCodes.BadBrowseDirectionInvalid)
        kinds = self._kinds(wanted.ReferenceTypeId, subtypes=wanted.IncludeSubtypes)
        return [
            masked(reference, wanted.ResultMask)
            for reference in node.references
            if reference.IsForward in directions
            and (kinds is None or reference.ReferenceTypeId in kinds)
            and (not wanted.NodeClassMask or wanted.NodeClassMask & reference.NodeClass)
        ]

    def _kinds(self, kind: ua.NodeId, *, subtypes: bool) -> frozenset[ua.NodeId] | None:
        if kind.is_null():
            return None
        found = self._space.get(kind)
        node_class = (
            found.attributes[ua.AttributeIds.NodeClass].value.Value.Value if found is not None else None
        )
        if node_class != ua.NodeClass.ReferenceType:
            raise FaultError(ua.StatusCodes.BadReferenceTypeIdInvalid)
        return self._with_subtypes(kind) if subtypes else frozenset({kind})

    def _with_subtypes(self, kind: ua.NodeId) -> frozenset[ua.NodeId]:
        known = self._subtypes.get(kind)
        if known is None:
            below = [self._with_subtypes(found) for found in targets(self._space[kind], HAS_SUBTYPE)]
            known = self._subtypes[kind] = frozenset({kind}).union(*below)
        return known

    async def browse_next(self, context: Context, wanted: ua.BrowseNextParameters) -> ua.BrowseNextResponse:
        """Go on where an answer was cut, or release what was kept for it."""
        response = ua.BrowseNextResponse()
        results = []
        for point in bounded(wanted.ContinuationPoints):
            result = ua.BrowseResult()
            try:
                rest, most = context.session.browse.take(point)
                if not wanted.ReleaseContinuationPoints:
                    result = page(rest, most, context.session.browse)
            except FaultError as fault:
                result.StatusCode = ua.StatusCode(fault.code)
            results.append(result)
        response.Parameters.Results = results
        return response

    async def translate(
        self, _context: Context, wanted: ua.TranslateBrowsePathsToNodeIdsParameters
    ) -> ua.TranslateBrowsePathsToNodeIdsResponse:
        """Follow paths of browse names."""
        response = ua.TranslateBrowsePathsToNodeIdsResponse()
        response.Results = [self._translate(path) for path in bounded(wanted.BrowsePaths)]
        return response

    def _translate(self, path: ua.BrowsePath) -> ua.BrowsePathResult:
        result = ua.BrowsePathResult()
        try:
            found = self._follow(path)
        except FaultError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
            return result
        result.Targets = [
            ua.BrowsePathTarget(
                TargetId=ua.ExpandedNodeId(node.Identifier, node.NamespaceIndex, node.NodeIdType),
                RemainingPathIndex=WHOLE_PATH,
            )
            for node in found
        ]
        return result

    def _follow(self, path: ua.BrowsePath) -> list[ua.NodeId]:
        elements = path.RelativePath.Elements
        if path.StartingNode not in self._space:
            raise FaultError(ua.StatusCodes.BadNodeIdUnknown)
        if not elements:
            raise FaultError(ua.StatusCodes.BadNothingToDo)
        if len(elements) > MAX_PATH:
            raise FaultError(ua.StatusCodes.BadTooManyOperations)
        current = [path.StartingNode]
        for element in elements:
            if not element.TargetName.Name:
                raise FaultError(ua.StatusCodes.BadBrowseNameInvalid)
            kinds = self._kinds(element.ReferenceTypeId, subtypes=element.IncludeSubtypes)
            current = [
                reference.NodeId
                for node in current
                if (data := self._space.get(node)) is not None
                for reference in data.references
                if reference.BrowseName == element.TargetName
                and reference.IsForward != element.IsInverse
                and (kinds is None or reference.ReferenceTypeId in kinds)
            ]
        if not current:
            raise FaultError(ua.StatusCodes.BadNoMatch)
        return list(dict.fromkeys(current))

    async def register(
        self, _context: Context, wanted: ua.RegisterNodesParameters
    ) -> ua.RegisterNodesResponse:
        """Take nodes a client will use often; their NodeIds are as quick as any."""
        response = ua.RegisterNodesResponse()
        response.Parameters.RegisteredNodeIds = bounded(wanted.NodesToRegister)
        return response

    async def unregister(
        self, _context: Context, wanted: ua.UnregisterNodesParameters
    ) -> ua.UnregisterNodesResponse:
        """Forget registered nodes."""
        bounded(wanted.NodesToUnregister)
        return ua.UnregisterNodesResponse()


def page(found: list[ua.ReferenceDescription], most: int, kept: Continuations) -> ua.BrowseResult:
    """Answer with as many references as fit, and keep the rest."""
    result = ua.BrowseResult()
    result.References = found[:most]
    if len(found) > most:
        result.ContinuationPoint = kept.keep((found[most:], most))
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
