"""The past of the cells, read in a process of its own: `python -m impactcell.journal.history_reader`.

Reading a page makes Python objects for milliseconds on end, and in a thread of the service it would hold the
interpreter that cells and clients wait for. Questions come in on stdin and answers go out on stdout, each a
MessagePack document behind its length; the process ends with its stdin. Each question opens its journal anew,
only to read: what replaces a file is seen, and no writer is held up.
"""

import contextlib
import os
import signal
import struct
import sys
from pathlib import Path
from typing import BinaryIO, Final

import msgspec

from impactcell.errors import JournalError
from impactcell.journal.checksums import CheckedTables
from impactcell.journal.database import errors, open_database
from impactcell.journal.history import HistoryQuery, stored_alarms, stored_values

LENGTH: Final = struct.Struct("<I")
"""Length of a document, bytes, before each of them."""
NICENESS: Final = 10
"""The past has time: cells and clients go before (nice(2))."""


class Question(msgspec.Struct, frozen=True):
    """A page of the journal at `path`: of a variable, or of alarms where `variable` is empty."""

    path: str
    variable: str
    query: HistoryQuery


class Answer(msgspec.Struct, frozen=True):
    """A page: columns of the values, or the records of the alarms, or why there is none."""

    times_ns: list[int] = []
    values: list[float] = []
    qualities: list[int] = []
    alarms: list[str] = []
    resume: bytes | None = None
    error: str = ""


def answer(question: Question) -> Answer:
    """Read a page."""
    path = Path(question.path)
    try:
        with errors(path):
            database = contextlib.closing(open_database(path, None, read_only=True))
        with errors(path), database as opened:
            is_whole = CheckedTables(opened, path).is_whole
            if not question.variable:
                records = stored_alarms(opened, question.query, is_whole)
                return Answer(alarms=list(records.entries), resume=records.resume)
            page = stored_values(opened, question.variable, question.query, is_whole)
    except JournalError as error:
        return Answer(error=str(error))
    return Answer(
        [entry.time_ns for entry in page.entries],
        [entry.value for entry in page.entries],
        [entry.quality.value for entry in page.entries],
        resume=page.resume,
    )


def serve(questions: BinaryIO, answers: BinaryIO) -> None:
    """Answer until there are no more questions."""
    decoder, encoder = msgspec.msgpack.Decoder(Question), msgspec.msgpack.Encoder()
    while len(head := questions.read(LENGTH.size)) == LENGTH.size:
        document = encoder.encode(answer(decoder.decode(questions.read(*LENGTH.unpack(head)))))
        answers.write(LENGTH.pack(len(document)) + document)
        answers.flush()


def main() -> None:
    """Serve stdin; Ctrl-C is for the service, which ends this process when it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICENESS)
    with contextlib.suppress(BrokenPipeError):
        serve(sys.stdin.buffer, sys.stdout.buffer)


if __name__ == "__main__":
    main()
