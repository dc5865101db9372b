"""The audit log of what people do over OPC UA: who called what with which arguments, and what came of it."""

import logging
from typing import Any, Final

from asyncua import ua

from impactcell.opcua.host_interface import Actor

_audit: Final = logging.getLogger("impactcell.audit")

MAX_ARGUMENT: Final = 200
"""Longest part of an argument that is logged, characters."""


class AuditTrail:
    """Implements `opcua.AuditLog`: every call of a method, refused ones too, but for refreshes."""

    def __init__(self) -> None:
        self._names: dict[tuple[ua.NodeId, ua.NodeId], str] = {}

    def add_method(self, owner: ua.NodeId, method: ua.NodeId, name: str) -> None:
        """Give a method of an object the name it is logged by; an empty one is not logged."""
        self._names[owner, method] = name

    def method_called(self, actor: Actor, request: ua.CallMethodRequest, status: int, reason: str) -> None:
        """Log a call."""
        ids = request.ObjectId, request.MethodId
        name = self._names.get(ids, " ".join(node.to_string() for node in ids))
        if not name:
            return
        arguments = ", ".join(_written(argument.Value) for argument in request.InputArguments or [])
        who = f"{actor.user} ({actor.role.name.lower()}) from {actor.address}"
        code = ua.StatusCode(status)
        if code.is_good():
            _audit.info("%s: %s(%s): done", who, name, arguments)
        else:
            _audit.warning("%s: %s(%s): refused, %s %s", who, name, arguments, code.name, reason)


def _written(value: Any) -> str:
    if isinstance(value, ua.LocalizedText):
        value = value.Text
    text = value.hex() if isinstance(value, bytes) else repr(value)
    return text if len(text) <= MAX_ARGUMENT else f"{text[:MAX_ARGUMENT]}..."
