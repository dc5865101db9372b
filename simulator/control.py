"""Faults on demand: a control port on loopback that takes one JSON object a line.

::

    {"fault": "delay", "probability": 0.1, "seconds": 0.2, "remaining": 5}   arm a fault of `simulator.faults`
    {"clear": "delay"}   {"clear": null}                                     disarm one kind, or all
    {"do": "restart"}    {"do": "set_counter", "value": 4294967290}          an action, with its arguments
    {"status": true}                                                         what happened so far

The answer is one JSON object a line: `{"ok": true, ...}` or `{"ok": false, "error": ...}`.
"""

import asyncio
import json
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any, Self

from impactcell.errors import MapError
from simulator.faults import Fault, FaultInjector, FaultKind

Action = Callable[..., object]


class Control:
    """The control port of one simulated module.

    Parameters
    ----------
    faults : FaultInjector
        Where faults are armed.
    actions : mapping
        What `do` may name, such as `restart`, `set_counter` and `overrun`.
    """

    def __init__(
        self, faults: FaultInjector, actions: Mapping[str, Action] | None = None, port: int = 0
    ) -> None:
        self.port = port
        self._faults = faults
        self._actions = dict(actions or {})
        self._server: asyncio.Server | None = None
        self._clients: set[asyncio.Task[None]] = set()

    async def __aenter__(self) -> Self:
        """Listen on loopback; `port` then is the one given by the system if it was 0."""
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop listening and drop every client."""
        if self._server is not None:
            self._server.close()
            for client in self._clients:
                client.cancel()
            await asyncio.gather(*self._clients, return_exceptions=True)
            await self._server.wait_closed()

    def obey(self, line: str | bytes) -> dict[str, Any]:
        """Carry out one command and return the answer."""
        try:
            return {"ok": True, **self._obey(dict(json.loads(line)))}
        except (ValueError, TypeError, KeyError, RecursionError, MapError) as error:
            return {"ok": False, "error": f"{type(error).__name__}: {error}"}

    def _obey(self, command: dict[str, Any]) -> dict[str, Any]:
        if "fault" in command:
            kind = FaultKind(command.pop("fault"))
            self._faults.inject(Fault(kind, **command))
            return {}
        if "clear" in command:
            self._faults.clear(None if command["clear"] is None else FaultKind(command["clear"]))
            return {}
        if "do" in command:
            name = command.pop("do")
            if name not in self._actions:
                raise ValueError(f"no action {name!r}; there are {', '.join(sorted(self._actions))}")
            return {"result": self._actions[name](**command)}
        if "status" in command:
            return {"happened": {str(kind): count for kind, count in self._faults.happened.items()}}
        raise ValueError("a command has fault, clear, do or status")

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None  # noqa: S101 - a coroutine always runs in one
        self._clients.add(task)
        try:
            while line := await reader.readline():
                writer.write(json.dumps(self.obey(line)).encode() + b"\n")
                await writer.drain()
        except (ConnectionError, ValueError):  # gone, or a line without end
            pass
        finally:
            self._clients.discard(task)
            writer.close()
