"""The alarms of the past as CSV (RFC 4180) and as a spreadsheet (Office Open XML)."""

import csv
import io
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Final

from impactcell.records import Alarm

HEADER: Final = (
    *("time_utc", "cell", "condition", "active", "acknowledged", "confirmed", "shelving", "severity"),
    *("cycle", "message", "user", "comment", "enabled", "suppressed", "comment_user"),
)
FORMULA_STARTS: Final = ("=", "+", "-", "@", "\t", "\r")
"""What a spreadsheet takes for the start of a formula; a text that begins so gets an apostrophe before it."""

Value = str | int


def _row(cell: str, alarm: Alarm) -> tuple[Value, ...]:
    moment = datetime.fromtimestamp(alarm.time_ns / 1e9, UTC)
    return (
        moment.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        *(cell, alarm.name, int(alarm.active), int(alarm.acknowledged), int(alarm.confirmed)),
        *(alarm.shelving.value, alarm.severity, alarm.cycle, alarm.message, alarm.user, alarm.comment),
        *(int(alarm.enabled), int(alarm.suppressed), alarm.comment_user),
    )


def _harmless(value: Value) -> Value:
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA_STARTS) else value


def to_csv(history: Sequence[tuple[str, Alarm]]) -> bytes:
    """Write CSV in UTF-8 with a byte order mark, which spreadsheets want."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(HEADER)
    writer.writerows([_harmless(value) for value in _row(cell, alarm)] for cell, alarm in history)
    return text.getvalue().encode("utf-8-sig")


def to_xlsx(history: Sequence[tuple[str, Alarm]]) -> bytes:
    """Write a workbook with one sheet; every text is a text, whatever it begins with."""
    from openpyxl import Workbook  # a tenth of a second of every start, for what is asked for now and then
    from openpyxl.cell import WriteOnlyCell

    book = Workbook(write_only=True)
    sheet = book.create_sheet("alarms")
    sheet.append(HEADER)
    for cell, alarm in history:
        cells = []
        for value in _row(cell, alarm):
            entry = WriteOnlyCell(sheet, value=_printable(value))
            if isinstance(value, str):
                entry.data_type = "s"
            cells.append(entry)
        sheet.append(cells)
    content = io.BytesIO()
    book.save(content)
    return content.getvalue()


def _printable(value: Value) -> Value:
    """Leave out control characters, which XML cannot hold."""
    if not isinstance(value, str):
        return value
    return "".join(character for character in value if character.isprintable() or character in "\n\t")
