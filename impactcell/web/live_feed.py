"""From the service's thread to many viewers: news in, frames out, each encoded once.

The service's thread does no more for it than to append to a bounded queue. Viewers who are too slow miss
frames, never the last state: what changed several times while one was sent is sent once, as it is then.
"""

import asyncio
import threading
from collections import deque
from collections.abc import Iterable

from impactcell.web.cell_view import KINDS, CellView
from impactcell.web.interface import CellNews

WAITING_NEWS = 256
"""News that may wait for the page's thread; the oldest give way, since the next cycle says all anew."""
UNSEEN_NEWS = 16
"""News that wait while nobody looks on: eight cycles, up to 400 kB each. To wake the page's thread for each
takes more processor time than the news do."""


class LiveFeed:
    """The cells of a page as they are now.

    `put` may be called from any thread; all else belongs to the thread of the page's event loop.
    """

    def __init__(self, cells: Iterable[str]) -> None:
        self._views = {cell: CellView(cell) for cell in cells}
        self._inbox: deque[CellNews] = deque(maxlen=WAITING_NEWS)
        self._lock = threading.Lock()
        self._is_woken = False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._versions = {(kind, cell): 1 for kind in KINDS for cell in self._views}
        self._encoded: dict[tuple[str, str], tuple[int, bytes]] = {}
        self._changed: set[asyncio.Event] = set()
        self.is_closed = False

    @property
    def views(self) -> dict[str, CellView]:
        """The cells by name, with all that has happened."""
        self._take_news()
        return self._views

    def start(self) -> None:
        """Take news from now on, in the event loop that runs."""
        self._loop = asyncio.get_running_loop()
        self._take_news()

    def close(self) -> None:
        """End every viewer's stream."""
        self.is_closed = True
        self._loop = None
        for event in self._changed:
            event.set()

    def put(self, news: CellNews) -> None:
        """Hand over what has happened; returns at once."""
        self._inbox.append(news)
        with self._lock:
            loop = self._loop
            if self._is_woken or loop is None:
                return
            if not self._changed and len(self._inbox) < UNSEEN_NEWS:
                return
            self._is_woken = True
        try:
            loop.call_soon_threadsafe(self._take_news)
        except RuntimeError:  # the page has just ended
            self._loop = None

    def subscribe(self) -> asyncio.Event:
        """Give an event that is set whenever something changed."""
        event = asyncio.Event()
        event.set()
        self._changed.add(event)
        self._take_news()  # in this order: what comes meanwhile wakes this thread
        return event

    def unsubscribe(self, event: asyncio.Event) -> None:
        """Forget an event."""
        self._changed.discard(event)

    @property
    def viewers(self) -> int:
        """How many look on."""
        return len(self._changed)

    def version(self, kind: str, cell: str) -> int:
        """Count the changes of one kind of content of a cell, from 1 on."""
        return self._versions[kind, cell]

    def frame(self, kind: str, cell: str) -> bytes:
        """Encode one of `cell_view.KINDS`, once for all who look at it."""
        version = self._versions[kind, cell]
        last = self._encoded.get((kind, cell))
        if last is None or last[0] != version or kind == "recent":
            data = self._views[cell].encode(kind)
            last = version, b"event: " + kind.encode() + b"\ndata: " + data + b"\n\n"
            self._encoded[kind, cell] = last
        return last[1]

    def _take_news(self) -> None:
        with self._lock:
            self._is_woken = False
        has_changed = False
        while self._inbox:
            news = self._inbox.popleft()
            for kind in self._views[news.cell].take(news):
                self._versions[kind, news.cell] += 1
                has_changed = True
        if has_changed:
            for event in self._changed:
                event.set()
