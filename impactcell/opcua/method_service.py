"""Call (Part 4, 5.12): who calls which method with what, checked before the method sees it.

Mended: asyncua tells a method nothing of its caller, checks neither number nor type of the arguments, lets
a method of one object be called on any other, and answers every failure with BadUnexpectedError.
"""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import FaultError
from impactcell.opcua.host_interface import AccessPolicy, Permission, RefusedError, Role
from impactcell.opcua.request_dispatch import Context, Service, bounded

MOST_CALLS = 100


@dataclass(frozen=True, slots=True)
class Argument:
    """An argument a method takes."""

    name: str
    kind: ua.VariantType


class ArgumentError(Exception):
    """An argument of the right type with a value that is refused."""

    def __init__(self, index: int, code: int) -> None:
        super().__init__(ua.StatusCode(code).name)
        self.index = index
        self.code = code


Run = Callable[[Context, Sequence[Any]], Awaitable[None]]


@dataclass(frozen=True, slots=True)
class Method:
    """A method as it can be called on one object."""

    arguments: tuple[Argument, ...]
    run: Run


class Calls:
    """Answers Call. Methods are bound to (object, method) pairs; anything else is no method of the object."""

    def __init__(self, space: AddressSpace, access: AccessPolicy) -> None:
        self._space = space
        self._access = access
        self._bound: dict[tuple[ua.NodeId, ua.NodeId], Method] = {}

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {"Call": Service(ua.CallParameters, self.call)}

    def bind(self, owner: ua.NodeId, method: ua.NodeId, bound: Method) -> None:
        """Make a method callable on an object."""
        self._bound[owner, method] = bound

    async def call(self, context: Context, wanted: ua.CallParameters) -> ua.CallResponse:
        """Call methods, one after the other."""
        response = ua.CallResponse()
        response.Results = [
            await self._call(context, each) for each in bounded(wanted.MethodsToCall, MOST_CALLS)
        ]
        return response

    async def _call(self, context: Context, wanted: ua.CallMethodRequest) -> ua.CallMethodResult:
        result = ua.CallMethodResult()
        arguments = list(wanted.InputArguments or [])
        try:
            method = self._find(wanted, context.actor.role)
            result.InputArgumentResults = _check(method, arguments)
            if any(not code.is_good() for code in result.InputArgumentResults):
                result.StatusCode = ua.StatusCode(ua.StatusCodes.BadInvalidArgument)
                return result
            await method.run(context, [argument.Value for argument in arguments])
        except FaultError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
        except ArgumentError as error:
            result.InputArgumentResults[error.index] = ua.StatusCode(error.code)
            result.StatusCode = ua.StatusCode(ua.StatusCodes.BadInvalidArgument)
        except RefusedError as refused:
            result.StatusCode = ua.StatusCode(getattr(ua.StatusCodes, refused.code))
        return result

    def _find(self, wanted: ua.CallMethodRequest, role: Role) -> Method:
        method = self._bound.get((wanted.ObjectId, wanted.MethodId))
        if method is not None:
            if not self._access.permits(role, Permission.CALL, wanted.MethodId):
                raise FaultError(ua.StatusCodes.BadUserAccessDenied)
            return method
        if wanted.ObjectId not in self._space:
            raise FaultError(ua.StatusCodes.BadNodeIdUnknown)
        raise FaultError(ua.StatusCodes.BadMethodInvalid)


def _check(method: Method, arguments: list[ua.Variant]) -> list[ua.StatusCode]:
    if len(arguments) < len(method.arguments):
        raise FaultError(ua.StatusCodes.BadArgumentsMissing)
    if len(arguments) > len(method.arguments):
        raise FaultError(ua.StatusCodes.BadTooManyArguments)
    results = []
    for wanted, given in zip(method.arguments, arguments, strict=True):
        fits = given.VariantType == wanted.kind and not isinstance(given.Value, list) and not given.is_array
        nullable = wanted.kind in (ua.VariantType.LocalizedText, ua.VariantType.ByteString)
        fits = fits or (nullable and given.VariantType == ua.VariantType.Null)
        results.append(ua.StatusCode(ua.StatusCodes.Good if fits else ua.StatusCodes.BadTypeMismatch))
    return results
