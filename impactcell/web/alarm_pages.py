"""Alarms: what is open now, what people do with it, what was, and the past as a file."""

from typing import Final

from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from impactcell.alarms import RULES, EventKind
from impactcell.errors import JournalError
from impactcell.records import Alarm
from impactcell.scada import ConditionAction, RefusedError
from impactcell.scada.alarm_events import event_id
from impactcell.web.alarm_export import to_csv, to_xlsx
from impactcell.web.cell_view import is_listed
from impactcell.web.page_context import PageContext
from impactcell.web.requests import RequestRefusedError
from impactcell.web.sessions import BrowserSession

SHOWN_HISTORY: Final = 200
"""Transitions of a cell that the page lists; the files have more."""
EXPORTED_HISTORY: Final = 10_000
"""Transitions of a cell in a file."""
ACTIONS: Final = {
    "acknowledge": EventKind.ACKNOWLEDGE,
    "confirm": EventKind.CONFIRM,
    "comment": EventKind.COMMENT,
    "shelve": EventKind.SHELVE_TIMED,
    "unshelve": EventKind.UNSHELVE,
}
"""What the page's forms offer, by the value of their button."""

OpenAlarm = tuple[str, Alarm, str]
"""A cell, its alarm, and the id of the event that told its state."""


def _open_alarms(context: PageContext) -> list[OpenAlarm]:
    """List what needs a look, most urgent first: not acknowledged, then active, then by severity."""
    alarms = [
        (cell, alarm, event_id(cell, alarm).hex())
        for cell, view in context.feed.views.items()
        for alarm in view.conditions.values()
        if is_listed(alarm)
    ]
    return sorted(alarms, key=lambda a: (a[1].acknowledged, not a[1].active, -a[1].severity, -a[1].time_ns))


async def _history(context: PageContext, cell: str | None, limit: int) -> list[tuple[str, Alarm]]:
    """Read what was, newest first, of one cell or of all."""
    entries: list[tuple[str, Alarm]] = []
    for facts in context.content.cells:
        if facts.journal is None or cell not in (None, facts.name):
            continue
        try:
            entries += [(facts.name, alarm) for alarm in await context.past.alarms(facts.journal, limit)]
        except JournalError:
            continue  # its own alarm says so
    return sorted(entries, key=lambda entry: -entry[1].time_ns)


async def alarms(context: PageContext, request: Request, session: BrowserSession) -> Response:
    """Show open alarms and the past."""
    cell = _chosen_cell(context, request)
    history = await _history(context, cell, SHOWN_HISTORY)
    return context.page(
        request,
        "alarms.html.j2",
        session,
        open_alarms=_open_alarms(context),
        history=history[:SHOWN_HISTORY],
        is_cut=len(history) >= SHOWN_HISTORY,
        most=EXPORTED_HISTORY,
        chosen=cell,
        refusal=request.query_params.get("refused", ""),
    )


async def rows(context: PageContext, request: Request, session: BrowserSession) -> Response:
    """Show the open alarms alone, for a page that brings itself up to date."""
    return context.page(request, "_open_alarms.html.j2", session, open_alarms=_open_alarms(context))


async def act(context: PageContext, _: Request, session: BrowserSession, form: dict[str, str]) -> Response:
    """Acknowledge, confirm, comment, shelve or unshelve an alarm."""
    try:
        alarm, event = RULES[form.get("alarm", "")].name, ACTIONS[form.get("action", "")]
        shown = bytes.fromhex(form.get("event_id", ""))
        shelve_s = 60.0 * float(form.get("minutes") or 0) if event is EventKind.SHELVE_TIMED else 0.0
    except (ValueError, KeyError) as error:
        raise RequestRefusedError(400, "error_form") from error
    cell = form.get("cell", "")
    if context.content.find(cell) is None:
        raise RequestRefusedError(404, "error_not_found")
    action = ConditionAction(event, shown, form.get("comment", "").strip(), shelve_s)
    try:
        await context.backend.act_on_condition(cell, alarm, action, session.actor)
    except RefusedError as error:
        if error.code == "BadUserAccessDenied":
            raise RequestRefusedError(403, "error_role") from error
        return RedirectResponse(f"/alarms?refused={error.code}", 303)
    return RedirectResponse("/alarms", 303)


async def history_csv(context: PageContext, request: Request, _: BrowserSession) -> Response:
    """Give the past as CSV."""
    history = await _history(context, _chosen_cell(context, request), EXPORTED_HISTORY)
    body = await context.past.run(lambda: to_csv(history))
    return _file(body, "text/csv; charset=utf-8", "alarms.csv")


async def history_xlsx(context: PageContext, request: Request, _: BrowserSession) -> Response:
    """Give the past as a spreadsheet."""
    history = await _history(context, _chosen_cell(context, request), EXPORTED_HISTORY)
    body = await context.past.run(lambda: to_xlsx(history))
    return _file(body, "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet", "alarms.xlsx")


def _file(body: bytes, media_type: str, name: str) -> Response:
    return Response(
        body, media_type=media_type, headers={"content-disposition": f'attachment; filename="{name}"'}
    )


def _chosen_cell(context: PageContext, request: Request) -> str | None:
    name = request.query_params.get("cell") or None
    if name is not None and context.content.find(name) is None:
        raise RequestRefusedError(404, "error_not_found")
    return name
