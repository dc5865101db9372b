"""Read and Write (Part 4, 5.11).

Mended: asyncua ignores index ranges, data encodings and the timestamps asked for, tells every user the same
access level, and lets users write what is not meant to be written.
"""

from typing import Final

from asyncua import ua

from impactcell.opcua.address_space.variable_store import with_timestamps
from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.filters.data_change_filter import cut, parse_range
from impactcell.opcua.host_interface import AccessPolicy, Permission, Role
from impactcell.opcua.languages import Languages
from impactcell.opcua.sessions.request_dispatch import RequestContext, Service, check_operations

ATTRIBUTE_IDS: Final = frozenset(int(attribute) for attribute in ua.AttributeIds)
DEFAULT_BINARY: Final = ua.QualifiedName("Default Binary", 0)
"""The one encoding of structures that is offered (Part 6, 5.2)."""


class AttributeService:
    """Answers Read and Write."""

    def __init__(self, space: AddressSpace, access: AccessPolicy, languages: Languages) -> None:
        self._space = space
        self._access = access
        self._languages = languages

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "Read": Service(ua.ReadParameters, self.read),
            "Write": Service(ua.WriteParameters, self.write),
        }

    async def read(self, context: RequestContext, parameters: ua.ReadParameters) -> ua.ReadResponse:
        """Read attributes."""
        read_values = check_operations(parameters.NodesToRead)
        if parameters.MaxAge < 0:
            raise StatusCodeError(ua.StatusCodes.BadMaxAgeInvalid)
        if parameters.TimestampsToReturn == ua.TimestampsToReturn.Invalid:
            raise StatusCodeError(ua.StatusCodes.BadTimestampsToReturnInvalid)
        role, language = context.actor.role, context.session.language

        def read(value: ua.ReadValueId) -> ua.DataValue:
            result = self._read_result(value, parameters.TimestampsToReturn, role)
            return self._languages.data(result, language)

        response = ua.ReadResponse()
        response.Results = await context.share.each(read_values, read)
        return response

    def _read_result(
        self, read_value: ua.ReadValueId, timestamps: ua.TimestampsToReturn, role: Role
    ) -> ua.DataValue:
        try:
            return self._read_value(read_value, timestamps, role)
        except StatusCodeError as fault:
            return ua.DataValue(StatusCode=ua.StatusCode(fault.code))

    def _read_value(
        self, read_value: ua.ReadValueId, timestamps: ua.TimestampsToReturn, role: Role
    ) -> ua.DataValue:
        if read_value.NodeId not in self._space:
            raise StatusCodeError(ua.StatusCodes.BadNodeIdUnknown)
        if not self._access.permits(role, Permission.READ, read_value.NodeId):
            raise StatusCodeError(ua.StatusCodes.BadUserAccessDenied)
        if read_value.AttributeId not in ATTRIBUTE_IDS:
            raise StatusCodeError(ua.StatusCodes.BadAttributeIdInvalid)
        attribute = ua.AttributeIds(read_value.AttributeId)
        index_range = parse_range(read_value.IndexRange)
        encoding = read_value.DataEncoding
        if attribute != ua.AttributeIds.Value:
            if encoding is not None and encoding.Name:
                raise StatusCodeError(ua.StatusCodes.BadDataEncodingInvalid)
            data = self.read_as(read_value.NodeId, attribute, role)
            return cut(ua.DataValue(data.Value, data.StatusCode), index_range)
        if encoding is not None and encoding.Name and encoding != DEFAULT_BINARY:
            raise StatusCodeError(ua.StatusCodes.BadDataEncodingUnsupported)
        data = self._space.read_attribute_value(read_value.NodeId, attribute)
        return with_timestamps(cut(data, index_range), timestamps)

    def read_as(self, node: ua.NodeId, attribute: ua.AttributeIds, role: Role) -> ua.DataValue:
        """Read an attribute as a role sees it: the `User...` attributes are of the reader."""
        data = self._space.read_attribute_value(node, attribute)
        if attribute == ua.AttributeIds.UserAccessLevel:
            return self._space.read_attribute_value(node, ua.AttributeIds.AccessLevel)
        if (
            attribute == ua.AttributeIds.UserExecutable
            and ua.AttributeIds.Executable in self._space[node].attributes
        ):
            may_call = self._access.permits(role, Permission.CALL, node)
            return ua.DataValue(ua.Variant(may_call, ua.VariantType.Boolean))
        return data

    async def write(self, context: RequestContext, parameters: ua.WriteParameters) -> ua.WriteResponse:
        """Refuse to write: what a client changes, it changes through methods."""
        response = ua.WriteResponse()
        role = context.actor.role
        response.Results = await context.share.each(
            check_operations(parameters.NodesToWrite), lambda value: ua.StatusCode(self._refusal(value, role))
        )
        return response

    def _refusal(self, write_value: ua.WriteValue, role: Role) -> int:
        codes = ua.StatusCodes
        if write_value.NodeId not in self._space:
            return int(codes.BadNodeIdUnknown)
        if write_value.AttributeId not in self._space[write_value.NodeId].attributes:
            return int(codes.BadAttributeIdInvalid)
        if not self._access.permits(role, Permission.WRITE, write_value.NodeId):
            return int(codes.BadUserAccessDenied)
        return int(codes.BadNotWritable)
