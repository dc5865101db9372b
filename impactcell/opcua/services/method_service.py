"""Call (Part 4, 5.12): who calls which method with what, checked before the method sees it.

Mended: asyncua tells a method nothing of its caller, checks neither number nor type of the arguments, lets
a method of one object be called on any other, and answers every failure with BadUnexpectedError.
"""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.host_interface import AccessPolicy, AuditLog, Permission, RefusedError, Role
from impactcell.opcua.sessions.request_dispatch import RequestContext, Service, check_operations

MAX_CALLS = 100
"""Methods in one Call."""


@dataclass(frozen=True, slots=True)
class InputArgument:
    """An argument a method takes."""

    name: str
    kind: ua.VariantType


class InvalidArgumentError(Exception):
    """An argument of the right type with a value that is refused."""

    def __init__(self, index: int, code: int) -> None:
        super().__init__(ua.StatusCode(code).name)
        self.index = index
        self.code = code


MethodHandler = Callable[[RequestContext, Sequence[Any]], Awaitable[None]]


@dataclass(frozen=True, slots=True)
class Method:
    """A method as it can be called on one object."""

    arguments: tuple[InputArgument, ...]
    handler: MethodHandler


class MethodService:
    """Answers Call. Methods are bound to (object, method) pairs; anything else is no method of the object."""

    def __init__(self, space: AddressSpace, access: AccessPolicy, audit: AuditLog) -> None:
        self._space = space
        self._access = access
        self._audit = audit
        self._bound: dict[tuple[ua.NodeId, ua.NodeId], Method] = {}

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {"Call": Service(ua.CallParameters, self.call, waits=True)}

    def bind(self, owner: ua.NodeId, method: ua.NodeId, bound: Method) -> None:
        """Make a method callable on an object."""
        self._bound[owner, method] = bound

    async def call(self, context: RequestContext, parameters: ua.CallParameters) -> ua.CallResponse:
        """Call methods, one after the other."""
        response = ua.CallResponse()
        response.Results = results = list[ua.CallMethodResult]()
        for request in check_operations(parameters.MethodsToCall, MAX_CALLS):
            results.append(await self._call(context, request))
            await context.share.give_way()
        return response

    async def _call(self, context: RequestContext, request: ua.CallMethodRequest) -> ua.CallMethodResult:
        result, reason = ua.CallMethodResult(), ""
        arguments = list(request.InputArguments or [])
        try:
            method = self._find(request, context.actor.role)
            result.InputArgumentResults = _check_arguments(method, arguments)
            if any(not code.is_good() for code in result.InputArgumentResults):
                result.StatusCode = ua.StatusCode(ua.StatusCodes.BadInvalidArgument)
                reason = _of_other_types(method, arguments, result.InputArgumentResults)
            else:
                await method.handler(context, [argument.Value for argument in arguments])
        except StatusCodeError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
        except InvalidArgumentError as error:
            result.InputArgumentResults[error.index] = ua.StatusCode(error.code)
            result.StatusCode = ua.StatusCode(ua.StatusCodes.BadInvalidArgument)
            reason = f"{method.arguments[error.index].name}: {error}"
        except RefusedError as refused:
            result.StatusCode, reason = status_of(refused), str(refused)
        self._audit.method_called(context.actor, request, result.StatusCode.value, reason)
        return result

    def _find(self, request: ua.CallMethodRequest, role: Role) -> Method:
        method = self._bound.get((request.ObjectId, request.MethodId))
        if method is not None:
            if not self._access.permits(role, Permission.CALL, request.MethodId):
                raise StatusCodeError(ua.StatusCodes.BadUserAccessDenied)
            return method
        if request.ObjectId not in self._space:
            raise StatusCodeError(ua.StatusCodes.BadNodeIdUnknown)
        raise StatusCodeError(ua.StatusCodes.BadMethodInvalid)


def status_of(refused: RefusedError) -> ua.StatusCode:
    """Status code that the host refuses with."""
    return ua.StatusCode(getattr(ua.StatusCodes, refused.code, ua.StatusCodes.BadUnexpectedError))


def _check_arguments(method: Method, arguments: list[ua.Variant]) -> list[ua.StatusCode]:
    if len(arguments) < len(method.arguments):
        raise StatusCodeError(ua.StatusCodes.BadArgumentsMissing)
    if len(arguments) > len(method.arguments):
        raise StatusCodeError(ua.StatusCodes.BadTooManyArguments)
    results = []
    for declared, argument in zip(method.arguments, arguments, strict=True):
        fits = (
            argument.VariantType == declared.kind
            and not isinstance(argument.Value, list)
            and not argument.is_array
        )
        nullable = declared.kind in (ua.VariantType.LocalizedText, ua.VariantType.ByteString)
        fits = fits or (nullable and argument.VariantType == ua.VariantType.Null)
        results.append(ua.StatusCode(ua.StatusCodes.Good if fits else ua.StatusCodes.BadTypeMismatch))
    return results


def _of_other_types(method: Method, arguments: list[ua.Variant], results: list[ua.StatusCode]) -> str:
    """Say which arguments are of another type than they should be."""
    told = []
    for declared, argument, code in zip(method.arguments, arguments, results, strict=True):
        if not code.is_good():
            given = f"{argument.VariantType.name}{'[]' if isinstance(argument.Value, list) else ''}"
            told.append(f"{declared.name} is a {given}, not a {declared.kind.name}")
    return "; ".join(told)
