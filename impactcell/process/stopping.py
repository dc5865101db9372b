"""Work that a stop ends at once, and work that it must not end halfway."""

import asyncio
import concurrent.futures
import threading
from collections.abc import Callable, Coroutine
from typing import Any, Final, TypeVar

STOPPED_EARLY: Final = "stopped while starting: no cell has run"
"""Said where a stop comes before the cells of a service run."""
T = TypeVar("T")


async def unless_stopped(work: Coroutine[Any, Any, object], stop: asyncio.Event) -> bool:
    """Do work that is cancelled when `stop` is set; say whether it was done."""
    working, stopping = asyncio.create_task(work), asyncio.create_task(stop.wait())
    try:
        await asyncio.wait({working, stopping}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        stopping.cancel()
        working.cancel()  # does nothing where it is done
        await asyncio.wait({working})
    if not working.cancelled():
        working.result()
    return not working.cancelled()


async def whole(work: Coroutine[Any, Any, T]) -> T:
    """Do work that is not to be left halfway: where it is cancelled, it is done first, and fails unheard."""
    working = asyncio.create_task(work)
    try:
        return await asyncio.shield(working)
    except asyncio.CancelledError:
        await asyncio.wait({working})
        if not working.cancelled():
            working.exception()  # heard by nobody, and not to be told as forgotten
        raise


async def in_passing_thread(work: Callable[[], T]) -> T:
    """Do work in a thread that nobody waits for at the end of the process.

    For what cannot be interrupted, as compiling, and leaves nothing open: cancelled, it is left to itself.
    """
    done: concurrent.futures.Future[T] = concurrent.futures.Future()

    def run() -> None:
        if done.set_running_or_notify_cancel():
            try:
                done.set_result(work())
            except BaseException as error:  # noqa: BLE001 - it is raised where it is waited for
                done.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return await asyncio.wrap_future(done)
