"""Faults that a scenario scripts: when they begin, how long they last, and what a module does at a moment.

A kind of `simulator.faults` befalls replies while it lasts; `restart`, `drop_clients`, `set_counter` and
`overrun` happen once.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, model_validator

from simulator.faults import Fault, FaultInjector, FaultKind
from simulator.scenario_file import ScenarioModel

_MOMENTARY: Final[Mapping[str, str | None]] = {
    "restart": None,
    "drop_clients": None,
    "set_counter": "value",
    "overrun": "cycles",
}
"""What happens at a moment, and the key that it needs."""


class ScheduledFault(ScenarioModel):
    """One entry of a scenario's `faults`; times are seconds of the wall clock since the server listens."""

    at_s: Annotated[float, Field(ge=0)]
    kind: Literal[
        "delay", "jitter", "drop", "half_open", "reset", "late_reply", "wrong_transaction", "wrong_length",
        "wrong_function", "wrong_unit", "wrong_protocol", "duplicate", "truncated", "joined", "split",
        "exception", "busy", "restart", "drop_clients", "set_counter", "overrun",
    ]  # fmt: skip
    lasts_s: Annotated[float, Field(gt=0)] | None = None
    probability: Annotated[float, Field(ge=0, le=1)] = 1.0
    seconds: Annotated[float, Field(ge=0)] = 0.2
    code: Annotated[int, Field(ge=1, le=255)] = 4
    value: Annotated[int, Field(ge=0, lt=2**32)] | None = None
    cycles: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        needed = _MOMENTARY.get(self.kind)
        for key in ("value", "cycles"):
            if (getattr(self, key) is not None) != (key == needed):
                message = f"{self.kind} {'needs' if key == needed else 'takes no'} {key}"
                raise ValueError(message)
        if self.kind in _MOMENTARY and self.lasts_s is not None:
            message = f"{self.kind} happens at a moment and takes no lasts_s"
            raise ValueError(message)
        return self


def arm(
    entries: Iterable[ScheduledFault], faults: FaultInjector, actions: Mapping[str, Callable[..., Any]]
) -> list[asyncio.TimerHandle]:
    """Set a timer of the running loop for each entry; cancel the handles to call it off.

    Parameters
    ----------
    actions : mapping
        What happens once: `restart()`, `drop_clients()`, `set_counter(value)` and `overrun(cycles)`.
    """
    loop = asyncio.get_running_loop()
    begun_s = loop.time()
    handles = []
    for entry in entries:
        if entry.kind in _MOMENTARY:
            needed = _MOMENTARY[entry.kind]
            arguments = () if needed is None else (getattr(entry, needed),)
            handles.append(loop.call_at(begun_s + entry.at_s, actions[entry.kind], *arguments))
            continue
        fault = Fault(FaultKind(entry.kind), entry.probability, None, entry.seconds, entry.code)
        handles.append(loop.call_at(begun_s + entry.at_s, faults.inject, fault))
        if entry.lasts_s is not None:
            handles.append(loop.call_at(begun_s + entry.at_s + entry.lasts_s, faults.withdraw, fault))
    return handles
