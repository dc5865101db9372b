"""Server-sent events (HTML Living Standard, 9.2) for one viewer."""

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from typing import Final

from starlette.types import Receive, Scope, Send

from impactcell.web.live_feed import LiveFeed

FRAME_S: Final = 0.25
"""Shortest time between two frames: fast enough for an eye, and cheap with many cells and viewers."""
HEARTBEAT_S: Final = 10.0
"""Without news a sign of life goes out this often: who hears none for long says so; who has gone is found."""
STALLED_S: Final = 30.0
"""A viewer who takes nothing for so long is let go; the browser comes back by itself."""
MAX_VIEWERS: Final = 100
"""Streams that are served at once."""

_HEADERS: Final = [
    (b"content-type", b"text/event-stream; charset=utf-8"),
    (b"cache-control", b"no-store"),
]


class EventStream:
    """Sends what changes of some cells until the viewer leaves; an ASGI response.

    Parameters
    ----------
    feed : LiveFeed
    cells : sequence of str
        Whose alarms are sent: every page counts all that are open.
    cards : sequence of str
        Whose cards are sent.
    detail : str or None
        The cell whose last tap is sent too.
    may_go_on : callable
        Whether the viewer is still logged in.
    """

    def __init__(
        self,
        feed: LiveFeed,
        cells: Sequence[str],
        cards: Sequence[str],
        detail: str | None,
        may_go_on: Callable[[], bool],
    ) -> None:
        self._feed = feed
        self._streams = [("alarms", cell) for cell in cells]
        self._streams += [(kind, cell) for cell in cards for kind in ("recent", "card")]
        if detail:
            self._streams.append(("detail", detail))
        self._may_go_on = may_go_on
        self._sent: dict[tuple[str, str], int] = {}

    async def __call__(self, _scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one viewer."""
        sending = asyncio.create_task(self._send_all(send), name="page viewer")
        leaving = asyncio.create_task(_left(receive), name="page viewer leaves")
        try:
            await asyncio.wait({sending, leaving}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in (sending, leaving):
                task.cancel()
            with contextlib.suppress(OSError, TimeoutError):
                for outcome in await asyncio.gather(sending, leaving, return_exceptions=True):
                    if isinstance(outcome, Exception):
                        raise outcome

    async def _send_all(self, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": _HEADERS})
        changed = self._feed.subscribe()
        try:
            while not self._feed.is_closed:
                changed.clear()  # before the frame is made: what comes from here on is in the next
                body = self._next_frame()
                if not self._may_go_on():
                    break
                await _send(send, body or b"event: alive\ndata: {}\n\n")
                await asyncio.sleep(FRAME_S)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(HEARTBEAT_S):
                        await changed.wait()
            await _send(send, b"", more=False)
        finally:
            self._feed.unsubscribe(changed)

    def _next_frame(self) -> bytes:
        frames = []
        for key in self._streams:
            version = self._feed.version(*key)
            if self._sent.get(key) != version:
                self._sent[key] = version
                frames.append(self._feed.frame(*key))
        return b"".join(frames)


async def _send(send: Send, body: bytes, *, more: bool = True) -> None:
    async with asyncio.timeout(STALLED_S):
        await send({"type": "http.response.body", "body": body, "more_body": more})


async def _left(receive: Receive) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
