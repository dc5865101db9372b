"""The audit log of what people do elsewhere than over OPC UA: who, what, and what came of it."""

import logging
from collections.abc import Awaitable
from typing import Final, TypeVar

from impactcell.alarms import EventKind
from impactcell.opcua.host_interface import Actor, RefusedError

T = TypeVar("T")

_log: Final = logging.getLogger("impactcell.audit")


async def audited(actor: Actor, what: str, work: Awaitable[T]) -> T:
    """Do what a person asks for, and log who asked and what came of it."""
    who = f"{actor.user} ({actor.role.name.lower()}) from {actor.address}"
    try:
        result = await work
    except RefusedError as refused:
        _log.warning("%s: %s: refused, %s: %s", who, what, refused.code, refused)
        raise
    _log.info("%s: %s: done", who, what)
    return result


def describe_action(cell: str, name: str, event: EventKind, comment: str, shelve_s: float) -> str:
    """Say what a person does with a condition, for the log."""
    what = f"{cell}: {name}: {event.value}"
    if comment:
        what += f" ({comment!r})"
    if event is EventKind.SHELVE_TIMED:
        what += f" ({shelve_s:g} s)"
    return what
