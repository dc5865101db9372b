"""The past of the cells for OPC UA, read from their journals by a process of its own.

One page is read at a time, in the order of the questions, so that nobody waits for more than the pages of
those who asked before. A page is small: whoever asks for more asks again, and others come in between.
"""

import asyncio
import contextlib
import sys
from collections.abc import Mapping
from typing import Final

import msgspec

from impactcell.errors import JournalError
from impactcell.journal.history import HistoryQuery
from impactcell.journal.history_reader import LENGTH, Answer, Question
from impactcell.journal.stored_forms import load_alarms
from impactcell.records import Quality
from impactcell.scada import AlarmPage, HistoryRequest, HistoryValue, RefusedError, ValuePage
from impactcell.service.cell_task import CellTask

VALUES_AT_ONCE: Final = 250
"""Values in a page: 4 ms of reading."""
ALARMS_AT_ONCE: Final = 25
"""Transitions in a page: 2 ms to make them records again, in this process."""
FIRST_NS, LAST_NS = -(2**63), 2**63 - 1
"""Times that a journal can hold, years 1677 to 2262. Clients ask for more: the greatest DateTime, of 9999,
stands for an end that is open."""


class JournalHistory:
    """Implements `scada.HistorySource` for the running cells; one without a journal has no past."""

    def __init__(self, cells: Mapping[str, CellTask]) -> None:
        self._cells = cells
        self._process: asyncio.subprocess.Process | None = None
        self._turn = asyncio.Lock()
        self._decoder = msgspec.msgpack.Decoder(Answer)

    async def values(self, cell: str, variable: str, request: HistoryRequest) -> ValuePage:
        """Read stored values of a variable, named by its path."""
        answer = await self._ask(cell, variable, _query(request, VALUES_AT_ONCE))
        columns = zip(answer.times_ns, answer.values, answer.qualities, strict=True)
        return ValuePage(tuple(HistoryValue(t, v, Quality(q)) for t, v, q in columns), answer.resume)

    async def alarms(self, cell: str, request: HistoryRequest) -> AlarmPage:
        """Read the transitions of the conditions of a cell."""
        answer = await self._ask(cell, "", _query(request, ALARMS_AT_ONCE))
        try:
            return AlarmPage(load_alarms(answer.alarms), answer.resume)
        except JournalError as error:
            raise RefusedError("BadResourceUnavailable", str(error)) from error

    async def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()

    async def _ask(self, cell: str, variable: str, query: HistoryQuery) -> Answer:
        if cell not in self._cells:
            raise RefusedError("BadResourceUnavailable", f"{cell}: its journal cannot be opened")
        settings = self._cells[cell].cell.settings.journal
        if settings is None:
            return Answer()
        question = msgspec.msgpack.encode(Question(str(settings.file), variable, query))
        await self._turn.acquire()
        # A page that nobody waits for any more is read to its end all the same, or its answer would be taken
        # for the next one's.
        exchange = asyncio.create_task(self._exchange(question), name="page of the past")
        exchange.add_done_callback(lambda _: self._turn.release())
        answer = await asyncio.shield(exchange)
        if answer.error:
            raise RefusedError("BadResourceUnavailable", answer.error)
        return answer

    async def _exchange(self, question: bytes) -> Answer:
        try:
            return self._decoder.decode(await self._answer(question))
        except (OSError, EOFError) as error:
            await self.close()
            return Answer(error=f"the past cannot be read now ({error})")

    async def _answer(self, question: bytes) -> bytes:
        if self._process is None:
            self._process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "impactcell.journal.history_reader"),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
            )
        questions, answers = self._process.stdin, self._process.stdout
        assert questions is not None  # noqa: S101 - both are pipes
        assert answers is not None  # noqa: S101
        questions.write(LENGTH.pack(len(question)) + question)
        await questions.drain()
        return await answers.readexactly(*LENGTH.unpack(await answers.readexactly(LENGTH.size)))


def _query(request: HistoryRequest, at_once: int) -> HistoryQuery:
    start_ns, end_ns = (
        None if time_ns is None else min(max(time_ns, FIRST_NS), LAST_NS)
        for time_ns in (request.start_ns, request.end_ns)
    )
    return HistoryQuery(start_ns, end_ns, min(request.limit, at_once), request.newest_first, request.resume)
