"""The audit log of what people do, over OPC UA and elsewhere: who, what, and what came of it."""

import logging
from collections.abc import Awaitable
from typing import Any, Final, TypeVar

from asyncua import ua

from impactcell.alarms import EventKind
from impactcell.opcua.host_interface import Actor, RefusedError

T = TypeVar("T")

_log: Final = logging.getLogger("impactcell.audit")

MAX_ARGUMENT: Final = 200
"""Longest part of an argument, or of a name that a client makes up, that is logged, characters."""
MAX_ARGUMENTS: Final = 8
"""Arguments of a call that are logged, and entries of one that is a list: no method takes more."""


def _log_outcome(actor: Actor, what: str, refusal: str = "") -> None:
    who = f"{actor.user} ({actor.role.name.lower()}) from {actor.address}"
    if refusal:
        _log.warning("%s: %s: refused, %s", who, what, refusal)
    else:
        _log.info("%s: %s: done", who, what)


async def audited(actor: Actor, what: str, work: Awaitable[T]) -> T:
    """Do what a person asks for, and log who asked and what came of it."""
    try:
        result = await work
    except RefusedError as refused:
        _log_outcome(actor, what, f"{refused.code}: {refused}")
        raise
    _log_outcome(actor, what)
    return result


def describe_action(cell: str, name: str, event: EventKind, comment: str, shelve_s: float) -> str:
    """Say what a person does with a condition, for the log."""
    what = f"{cell}: {name}: {event.value}"
    if comment:
        what += f" ({comment!r})"
    if event is EventKind.SHELVE_TIMED:
        what += f" ({shelve_s:g} s)"
    return what


class MethodAudit:
    """Implements `opcua.AuditLog`: every call of a method, refused ones too, but for refreshes."""

    def __init__(self) -> None:
        self._names: dict[tuple[ua.NodeId, ua.NodeId], str] = {}

    def add_method(self, owner: ua.NodeId, method: ua.NodeId, name: str) -> None:
        """Give a method of an object the name it is logged by; an empty one is not logged."""
        self._names[owner, method] = name

    def method_called(self, actor: Actor, request: ua.CallMethodRequest, status: int, reason: str) -> None:
        """Log a call."""
        ids = request.ObjectId, request.MethodId
        name = self._names.get(ids, " ".join(_one_line(node.to_string()) for node in ids))
        if not name:
            return
        given = request.InputArguments or []
        arguments = ", ".join(_written(argument.Value) for argument in given[:MAX_ARGUMENTS])
        if len(given) > MAX_ARGUMENTS:
            arguments += f", {len(given) - MAX_ARGUMENTS} more"
        code = ua.StatusCode(status)
        refusal = code.name if reason in ("", code.name) else f"{code.name} {reason}"
        _log_outcome(actor, f"{name}({arguments})", "" if code.is_good() else refusal)


def _written(value: Any) -> str:
    """Write an argument, without going through the whole of a long one."""
    if isinstance(value, ua.LocalizedText):
        value = value.Text
    if isinstance(value, list):
        more = f", {len(value) - MAX_ARGUMENTS} more" if len(value) > MAX_ARGUMENTS else ""
        return f"[{', '.join(map(_written, value[:MAX_ARGUMENTS]))}{more}]"
    if isinstance(value, bytes):
        return value[:MAX_ARGUMENT].hex()
    if isinstance(value, str):
        value = value[: MAX_ARGUMENT + 1]
    return _shortened(repr(value))


def _one_line(text: str) -> str:
    """Write what a client makes up as one line of a log, whatever is in it."""
    return _shortened(ascii(text[: MAX_ARGUMENT + 1])[1:-1])


def _shortened(text: str) -> str:
    return text if len(text) <= MAX_ARGUMENT else f"{text[:MAX_ARGUMENT]}..."
