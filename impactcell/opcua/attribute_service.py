"""Read and Write (Part 4, 5.11).

Mended: asyncua ignores index ranges, data encodings and the timestamps asked for, tells every user the same
access level, and lets users write what is not meant to be written.
"""

from typing import Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import FaultError
from impactcell.opcua.data_change_filter import cut, parse_range
from impactcell.opcua.host_interface import AccessPolicy, Permission, Role
from impactcell.opcua.node_values import with_timestamps
from impactcell.opcua.request_dispatch import Context, Service, bounded

KNOWN_ATTRIBUTES: Final = frozenset(int(attribute) for attribute in ua.AttributeIds)
BINARY: Final = ua.QualifiedName("Default Binary", 0)


class Attributes:
    """Answers Read and Write."""

    def __init__(self, space: AddressSpace, access: AccessPolicy) -> None:
        self._space = space
        self._access = access

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "Read": Service(ua.ReadParameters, self.read),
            "Write": Service(ua.WriteParameters, self.write),
        }

    async def read(self, context: Context, wanted: ua.ReadParameters) -> ua.ReadResponse:
        """Read attributes."""
        nodes = bounded(wanted.NodesToRead)
        if wanted.MaxAge < 0:
            raise FaultError(ua.StatusCodes.BadMaxAgeInvalid)
        if wanted.TimestampsToReturn == ua.TimestampsToReturn.Invalid:
            raise FaultError(ua.StatusCodes.BadTimestampsToReturnInvalid)
        role = context.actor.role
        response = ua.ReadResponse()
        response.Results = [self._read(node, wanted.TimestampsToReturn, role) for node in nodes]
        return response

    def _read(self, wanted: ua.ReadValueId, timestamps: ua.TimestampsToReturn, role: Role) -> ua.DataValue:
        try:
            return self._value(wanted, timestamps, role)
        except FaultError as fault:
            return ua.DataValue(StatusCode=ua.StatusCode(fault.code))

    def _value(self, wanted: ua.ReadValueId, timestamps: ua.TimestampsToReturn, role: Role) -> ua.DataValue:
        if wanted.NodeId not in self._space:
            raise FaultError(ua.StatusCodes.BadNodeIdUnknown)
        if not self._access.permits(role, Permission.READ, wanted.NodeId):
            raise FaultError(ua.StatusCodes.BadUserAccessDenied)
        if wanted.AttributeId not in KNOWN_ATTRIBUTES:
            raise FaultError(ua.StatusCodes.BadAttributeIdInvalid)
        attribute = ua.AttributeIds(wanted.AttributeId)
        span = parse_range(wanted.IndexRange)
        encoding = wanted.DataEncoding
        if attribute != ua.AttributeIds.Value:
            if encoding is not None and encoding.Name:
                raise FaultError(ua.StatusCodes.BadDataEncodingInvalid)
            held = self.own_view(wanted.NodeId, attribute, role)
            return cut(ua.DataValue(held.Value, held.StatusCode), span)
        if encoding is not None and encoding.Name and encoding != BINARY:
            raise FaultError(ua.StatusCodes.BadDataEncodingUnsupported)
        held = self._space.read_attribute_value(wanted.NodeId, attribute)
        return with_timestamps(cut(held, span), timestamps)

    def own_view(self, node: ua.NodeId, attribute: ua.AttributeIds, role: Role) -> ua.DataValue:
        """Read an attribute as a role sees it: the `User...` attributes are of the reader."""
        held = self._space.read_attribute_value(node, attribute)
        if attribute == ua.AttributeIds.UserAccessLevel:
            return self._space.read_attribute_value(node, ua.AttributeIds.AccessLevel)
        if (
            attribute == ua.AttributeIds.UserExecutable
            and ua.AttributeIds.Executable in self._space[node].attributes
        ):
            may_call = self._access.permits(role, Permission.CALL, node)
            return ua.DataValue(ua.Variant(may_call, ua.VariantType.Boolean))
        return held

    async def write(self, context: Context, wanted: ua.WriteParameters) -> ua.WriteResponse:
        """Refuse to write: what a client changes, it changes through methods."""
        response = ua.WriteResponse()
        response.Results = [
            ua.StatusCode(self._refusal(node, context.actor.role)) for node in bounded(wanted.NodesToWrite)
        ]
        return response

    def _refusal(self, wanted: ua.WriteValue, role: Role) -> int:
        codes = ua.StatusCodes
        if wanted.NodeId not in self._space:
            return int(codes.BadNodeIdUnknown)
        if wanted.AttributeId not in self._space[wanted.NodeId].attributes:
            return int(codes.BadAttributeIdInvalid)
        if not self._access.permits(role, Permission.WRITE, wanted.NodeId):
            return int(codes.BadUserAccessDenied)
        return int(codes.BadNotWritable)
