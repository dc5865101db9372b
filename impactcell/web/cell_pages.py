"""The cells: all of them at a glance, one of them in depth, and the stream that keeps both alive."""

from dataclasses import replace
from itertools import pairwise
from statistics import median_low
from typing import Any, Final

from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp

from impactcell.errors import JournalError
from impactcell.journal.trend import Shift, TrendColumn
from impactcell.scada import RefusedError
from impactcell.web.cell_view import number
from impactcell.web.event_stream import MAX_VIEWERS, EventStream
from impactcell.web.interface import CellFacts
from impactcell.web.listed_values import listed_values
from impactcell.web.page_context import PageContext
from impactcell.web.past import SPANS_S
from impactcell.web.requests import RequestRefusedError
from impactcell.web.sessions import BrowserSession

STANDSTILL: Final = 5.0
"""Usual distances between columns; farther apart, the cell stood still between them. Our choice."""
NOTHING: Final = TrendColumn(0, 0, None, None, None, None, None, None)
"""A column without a value, at which line and band of a chart break off."""


async def overview(context: PageContext, request: Request, session: BrowserSession) -> Response:
    """Show a card a cell."""
    return context.page(request, "overview.html.j2", session)


async def cell(context: PageContext, request: Request, session: BrowserSession) -> Response:
    """Show one cell."""
    return context.page(
        request,
        "cell.html.j2",
        session,
        cell=_cell(context, request),
        spans=tuple(SPANS_S),
        folders=listed_values(context.language(request)),
        refusal=request.query_params.get("refused", ""),
        was_reset=request.query_params.get("done") == "reset-wear",
    )


async def reset_wear(
    context: PageContext, request: Request, session: BrowserSession, form: dict[str, str]
) -> Response:
    """Learn the wear level anew: worn parts were replaced."""
    name = _cell(context, request).name
    try:
        await context.backend.reset_wear(name, form.get("comment", "").strip(), session.actor)
    except RefusedError as error:
        if error.code == "BadUserAccessDenied":
            raise RequestRefusedError(403, "error_role") from error
        return RedirectResponse(f"/cells/{name}?refused={error.code}", 303)
    return RedirectResponse(f"/cells/{name}?done=reset-wear", 303)


async def live(context: PageContext, request: Request, session: BrowserSession) -> Response | ASGIApp:
    """Stream what changes: of all cells, or of one with its last tap; alarms are those of all."""
    name = request.query_params.get("cell")
    if name is not None and context.content.find(name) is None:
        return JSONResponse({"error": "no such cell"}, 404)
    cards = [name] if name is not None else [facts.name for facts in context.content.cells]
    return _stream(context, session, cards, name)


async def live_alarms(context: PageContext, _: Request, session: BrowserSession) -> Response | ASGIApp:
    """Stream the alarms alone, for a page that shows no cell."""
    return _stream(context, session, [], None)


def _stream(
    context: PageContext, session: BrowserSession, cards: list[str], detail: str | None
) -> Response | ASGIApp:
    if context.feed.viewers >= MAX_VIEWERS:
        return JSONResponse({"error": "too many viewers"}, 503)
    cells, token = [facts.name for facts in context.content.cells], session.token
    may_go_on = lambda: context.sessions.find(token) is not None  # noqa: E731
    return EventStream(context.feed, cells, cards, detail, may_go_on)


async def trend(context: PageContext, request: Request, _: BrowserSession) -> Response:
    """Give the trend of a cell over the last hour, shift or month."""
    facts, span = _cell(context, request), request.query_params.get("span", "hour")
    if span not in SPANS_S:
        return JSONResponse({"error": f"span is one of {', '.join(SPANS_S)}"}, 400)
    if facts.journal is None:
        return Response(status_code=204)
    try:
        columns, shifts = await context.past.trend(facts.journal, span)
    except JournalError:
        return JSONResponse({"error": "the journal cannot be read now"}, 503)
    return JSONResponse(_trend_content(columns, shifts))


def _cell(context: PageContext, request: Request) -> CellFacts:
    facts = context.content.find(request.path_params["cell"])
    if facts is None:
        raise RequestRefusedError(404, "error_not_found")
    return facts


def _trend_content(columns: tuple[TrendColumn, ...], shifts: tuple[Shift, ...]) -> dict[str, Any]:
    """Give the series of a trend, where a batch begins, and where the material is found to have changed."""

    def series(values: list[float | None]) -> list[float | None]:
        return [None if value is None else number(value) for value in values]

    columns = _with_gaps(columns)
    batches: list[tuple[int, str]] = []
    for column in columns:
        if column.batch_id and (not batches or batches[-1][1] != column.batch_id):
            batches.append((column.time_ns // 1_000_000, column.batch_id))
    return {
        "time_ms": [column.time_ns // 1_000_000 for column in columns],
        "mu_s_low": series([column.mu_s_low for column in columns]),
        "mu_s_high": series([column.mu_s_high for column in columns]),
        "level": series([column.level for column in columns]),
        "level_std": series([column.level_std for column in columns]),
        "gap": series([column.gap for column in columns]),
        "batches": batches,
        "shifts": [
            {
                "time_ms": shift.time_ns // 1_000_000,
                "cycle": shift.cycle,
                "size": number(shift.size),
                "size_std": number(shift.size_std),
            }
            for shift in shifts
        ],
    }


def _with_gaps(columns: tuple[TrendColumn, ...]) -> tuple[TrendColumn, ...]:
    """Put a column without values into each standstill: nobody knows what friction was in it."""
    steps = [later.time_ns - column.time_ns for column, later in pairwise(columns)]
    if not steps:
        return columns
    longest, told = STANDSTILL * median_low(steps), [columns[0]]
    for step, column in zip(steps, columns[1:], strict=True):
        if step > longest:
            told.append(replace(NOTHING, time_ns=column.time_ns - step // 2))
        told.append(column)
    return tuple(told)
