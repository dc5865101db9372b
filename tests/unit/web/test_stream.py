"""The stream: every viewer gets the last state, encoded once, and a slow one holds up nobody."""

import asyncio
import json
import threading
from pathlib import Path
from typing import Any

import pytest

from impactcell.records import ModuleStatus, Snapshot
from impactcell.scada import Role
from impactcell.web import event_stream
from impactcell.web.cell_view import CellView
from impactcell.web.event_stream import MAX_VIEWERS, EventStream
from impactcell.web.interface import CellNews
from impactcell.web.live_feed import UNSEEN_NEWS, WAITING_NEWS, LiveFeed
from tests.patience import PATIENCE_S
from tests.snapshots import make_capture, make_snapshot
from tests.unit.web.page import CELL, make_page, raised


def cycle(number: int) -> Snapshot:
    return make_snapshot(make_capture(number))


class Viewer:
    """The other end of a stream: reads only what it is allowed to."""

    def __init__(self, feed: LiveFeed, *, detail: str | None = None, reads: int = 10**6) -> None:
        self.stream = EventStream(feed, [CELL], [CELL], detail, lambda: self.may_go_on)
        self.may_go_on = True
        self.may_read = asyncio.Semaphore(reads)
        self.bodies: list[bytes] = []
        self.news = asyncio.Condition()
        self.left = asyncio.Event()
        self.task = asyncio.create_task(self.stream({}, self._receive, self._send))

    async def _receive(self) -> dict[str, Any]:
        await self.left.wait()
        return {"type": "http.disconnect"}

    async def _send(self, message: Any) -> None:
        await self.may_read.acquire()
        async with self.news:
            if message["type"] == "http.response.body":
                self.bodies.append(message["body"])
            self.news.notify_all()

    def events(self, kind: str = "card") -> list[dict[str, Any]]:
        text = b"".join(self.bodies).decode()
        blocks = [block.split("\n") for block in text.split("\n\n") if block.startswith(f"event: {kind}\n")]
        return [json.loads(block[1].removeprefix("data: ")) for block in blocks]

    def cycles(self) -> list[int]:
        """Cycles of the cards that came, but for the empty one before the first."""
        values = (event["values"].get("Friction/CycleNumber") for event in self.events())
        return [cycle for cycle in values if cycle is not None]

    async def until_cycle(self, number: int) -> None:
        async with asyncio.timeout(PATIENCE_S), self.news:
            await self.news.wait_for(lambda: number in self.cycles())

    async def leave(self) -> None:
        self.left.set()
        await self.task


@pytest.fixture(autouse=True)
def no_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames follow each other as fast as they are read."""
    monkeypatch.setattr(event_stream, "FRAME_S", 0.0)


@pytest.fixture
async def feed() -> LiveFeed:
    feed = LiveFeed([CELL])
    feed.start()
    return feed


async def test_a_viewer_sees_what_is_and_what_comes(feed: LiveFeed) -> None:
    feed.put(CellNews(CELL, cycle(1), make_capture(1)))
    viewer = Viewer(feed, detail=CELL)
    await viewer.until_cycle(1)
    feed.put(CellNews(CELL, cycle(2), make_capture(2)))
    await viewer.until_cycle(2)
    await viewer.leave()
    assert viewer.cycles() == [1, 2]
    assert viewer.events("recent") == [{"cell": CELL, "recent": [[1, 0.2, 0.2]]}]
    assert viewer.events("detail")[-1]["usual_taps"] == 1
    assert feed.viewers == 0


async def test_a_frame_is_encoded_once_for_all(feed: LiveFeed, monkeypatch: pytest.MonkeyPatch) -> None:
    encoded: list[str] = []
    encode = CellView.encode
    monkeypatch.setattr(CellView, "encode", lambda view, kind: (encoded.append(kind), encode(view, kind))[1])
    viewers = [Viewer(feed) for _ in range(20)]
    for number in (1, 2, 3):
        feed.put(CellNews(CELL, cycle(number)))
        for viewer in viewers:
            await viewer.until_cycle(number)
    for viewer in viewers:
        await viewer.leave()
    assert (
        3 <= encoded.count("card") <= 4
    )  # the empty card before the first cycle too, if somebody was there in time


@pytest.mark.slow
async def test_a_slow_viewer_misses_frames_and_never_the_last(feed: LiveFeed) -> None:
    slow, quick = Viewer(feed, reads=1), Viewer(feed)
    for number in range(1, 101):
        feed.put(CellNews(CELL, cycle(number)))
        await quick.until_cycle(number)
    assert slow.events() == []  # all it took so far is the head of the answer
    for _ in range(10):
        slow.may_read.release()
    await slow.until_cycle(100)
    assert len(slow.cycles()) <= 2
    assert len(quick.cycles()) == 100
    await slow.leave()
    await quick.leave()


@pytest.mark.parametrize("steps", range(10))
async def test_who_leaves_as_news_come_has_left(feed: LiveFeed, steps: int) -> None:
    viewer = Viewer(feed)
    feed.put(CellNews(CELL, cycle(1)))
    await viewer.until_cycle(1)
    for _ in range(20):  # past the rest between two frames: it waits for news
        await asyncio.sleep(0)
    feed.put(CellNews(CELL, cycle(2)))
    for _ in range(steps):
        await asyncio.sleep(0)
    async with asyncio.timeout(PATIENCE_S):
        await viewer.leave()
    assert feed.viewers == 0


async def test_a_viewer_who_takes_nothing_is_let_go(feed: LiveFeed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_stream, "STALLED_S", 0.0)
    viewer = Viewer(feed, reads=1)
    async with asyncio.timeout(PATIENCE_S):
        await viewer.task
    assert feed.viewers == 0


async def test_the_stream_ends_with_the_session(feed: LiveFeed) -> None:
    viewer = Viewer(feed)
    feed.put(CellNews(CELL, cycle(1)))
    await viewer.until_cycle(1)
    viewer.may_go_on = False
    feed.put(CellNews(CELL, cycle(2)))
    async with asyncio.timeout(PATIENCE_S):
        await viewer.task
    assert viewer.cycles() == [1]


async def test_the_stream_ends_with_the_service(feed: LiveFeed) -> None:
    viewer = Viewer(feed)
    feed.put(CellNews(CELL, cycle(1)))
    await viewer.until_cycle(1)
    feed.close()
    async with asyncio.timeout(PATIENCE_S):
        await viewer.task
    feed.put(CellNews(CELL, cycle(2)))  # late news hurt nobody


async def test_news_come_from_another_thread_in_their_order(feed: LiveFeed) -> None:
    viewer = Viewer(feed)

    def produce() -> None:
        for number in range(1, 201):
            feed.put(CellNews(CELL, cycle(number), status=ModuleStatus(received=number)))

    thread = threading.Thread(target=produce)
    thread.start()
    await viewer.until_cycle(200)
    thread.join()
    await viewer.leave()
    assert viewer.cycles() == sorted(set(viewer.cycles()))
    assert viewer.events()[-1]["values"]["Module/CyclesReceived"] == 200


def test_what_waits_is_bounded_and_the_newest_stays() -> None:
    feed = LiveFeed([CELL])
    for number in range(1, 3 * WAITING_NEWS):
        feed.put(CellNews(CELL, status=ModuleStatus(received=number)))

    async def start() -> None:
        feed.start()

    asyncio.run(start())
    assert feed.version("card", CELL) == 1 + WAITING_NEWS
    assert feed.views[CELL].status.received == 3 * WAITING_NEWS - 1


async def test_the_page_is_not_woken_for_each_cycle_while_nobody_looks_on(
    feed: LiveFeed, monkeypatch: pytest.MonkeyPatch
) -> None:
    woken: list[object] = []
    loop = asyncio.get_running_loop()
    monkeypatch.setattr(loop, "call_soon_threadsafe", lambda work: woken.append(work))
    for number in range(1, UNSEEN_NEWS):
        feed.put(CellNews(CELL, snapshot=cycle(number)))
    assert not woken
    feed.put(CellNews(CELL, snapshot=cycle(UNSEEN_NEWS)))
    assert len(woken) == 1


async def test_who_comes_or_looks_sees_what_nobody_was_woken_for(feed: LiveFeed) -> None:
    feed.put(CellNews(CELL, snapshot=cycle(1)))
    shown = feed.views[CELL].snapshot
    assert shown is not None
    assert shown.cycle == 1
    feed.put(CellNews(CELL, snapshot=cycle(2)))
    version = feed.version("card", CELL)
    changed = feed.subscribe()
    assert changed.is_set()
    assert feed.version("card", CELL) == version + 1
    feed.unsubscribe(changed)


async def test_an_alarm_between_cycles_is_shown(feed: LiveFeed) -> None:
    feed.put(CellNews(CELL, cycle(1)))
    feed.put(CellNews(CELL, alarms=(raised(),)))
    await asyncio.sleep(0)
    alarms = json.loads(feed.views[CELL].encode("alarms"))["alarms"]
    [alarm] = [alarm for alarm in alarms if alarm["active"]]
    assert alarm["name"] == "DeviantCycle"
    assert alarm["message"] == {"en": "friction is off", "de": ""}


async def test_more_viewers_than_allowed_are_told_so(tmp_path: Path) -> None:
    page = make_page(tmp_path)
    for _ in range(MAX_VIEWERS):
        page.feed.subscribe()
    async with page.logged_in(Role.OBSERVER) as client:
        assert (await client.get("/live")).status_code == 503


async def test_who_looks_at_the_system_takes_the_news_in_the_thread_of_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What another thread takes wakes nobody, and may be an older state after a newer one."""
    page, threads, take = make_page(tmp_path), set(), CellView.take
    seen = lambda view, news: (threads.add(threading.current_thread()), take(view, news))[1]  # noqa: E731
    monkeypatch.setattr(CellView, "take", seen)
    async with page.logged_in(Role.OBSERVER) as client:
        page.feed.put(CellNews(CELL, status=ModuleStatus(connected=True, received=5)))
        assert (await client.get("/system")).status_code == 200
    assert threads == {threading.current_thread()}
