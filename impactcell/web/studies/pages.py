"""The pages of studies: drop files, confirm what was read, see what came out, put its model into service."""

import asyncio
import logging
from pathlib import Path
from typing import Final

from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, RedirectResponse, Response

from impactcell.german.findings import REPORTS
from impactcell.scada import RefusedError, Role
from impactcell.web.messages import Messages
from impactcell.web.page_context import PageContext
from impactcell.web.requests import CSRF_FIELD, RequestRefusedError
from impactcell.web.sessions import BrowserSession
from impactcell.web.studies.queue import PROGRAM_FAULT, is_choice
from impactcell.web.studies.study import Acceptance, Goal, Stage, Study
from impactcell.web.studies.two_values import differing_parameters
from impactcell.web.studies.upload import KINDS, MAX_FILES, receive, safe_name
from impactcell.web.texts.model_faults import is_untold

_log: Final = logging.getLogger(__name__)

MAX_TITLE: Final = 80
"""Longest title, in characters."""
MAX_RECEIVING: Final = 5
"""Files that are received at once: each holds a connection, and they share one disk."""
DOWNLOADS: Final = ("result.json", "model.extended.yaml", *REPORTS.values(), "friction.csv")
"""Files of a result that can be taken home."""
REPORT_POLICY: Final = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'self'; sandbox"
)
"""What a report may do: show itself. It has its own style and pictures inside, and needs nothing else."""


async def studies(context: PageContext, request: Request, session: BrowserSession) -> Response:
    """List the studies, and offer to drop files."""
    queue = context.studies
    listed = [(study, queue.place(study), queue.store.is_in_service(study)) for study in queue.store]
    return context.page(request, "studies.html.j2", session, studies=listed, kinds=",".join(sorted(KINDS)))


async def begin(context: PageContext, _: Request, session: BrowserSession, form: dict[str, str]) -> Response:
    """Begin a study; its files come next."""
    cell = form.get("cell", "")
    facts = context.content.find(cell)
    if cell and facts is None:
        raise RequestRefusedError(404, "error_not_found")
    if context.studies.is_full:
        raise RequestRefusedError(503, "error_queue_full")
    title = "".join(c for c in form.get("title", "") if c.isprintable()).strip()[:MAX_TITLE]
    try:
        study = await asyncio.to_thread(
            context.studies.store.begin, title or "data", session.actor.user, cell
        )
    except OSError as error:
        raise RequestRefusedError(507, "error_no_room") from error
    if facts is not None and facts.stroke_m is not None:
        study.choices = {"set.stroke": f"{1e3 * facts.stroke_m:.6g} mm"}  # no file says it
    return JSONResponse({"id": study.id}, 201)


async def upload(context: PageContext, request: Request, _: BrowserSession) -> Response:
    """Receive one file of a study."""
    study = _study(context, request)
    if study.stage is not Stage.RECEIVING:
        raise RequestRefusedError(409, "error_study_stage")
    name = safe_name(request.query_params.get("name", ""))
    if len(study.files) >= MAX_FILES or name in study.files:
        raise RequestRefusedError(409, "error_file_there" if name in study.files else "error_too_many_files")
    if len(context.receiving) >= MAX_RECEIVING:
        raise RequestRefusedError(503, "error_queue_full")
    target = context.studies.store.files(study) / name
    study.files = {**study.files, name: 0}

    def study_bytes(size: int) -> int:
        context.receiving[target] = size
        coming = sum(more for path, more in context.receiving.items() if path.parent == target.parent)
        return sum(study.files.values()) + coming

    study_bytes(0)
    try:
        size = await receive(request, target, study_bytes)
        study.files = {**study.files, name: size}
    except ClientDisconnect:
        return Response(status_code=400)  # nobody reads it
    finally:
        del context.receiving[target]
        if not study.files[name]:
            study.files = {other: size for other, size in study.files.items() if other != name}
    context.studies.store.save(study)
    return JSONResponse({"name": name, "size": size}, 201)


async def read(context: PageContext, request: Request, _: BrowserSession, form: dict[str, str]) -> Response:
    """Have the files read, with what was chosen of columns and units."""
    study = _study(context, request)
    if study.is_working or not study.files:
        raise RequestRefusedError(409, "error_study_stage")
    fields = {name: value.strip() for name, value in form.items() if name != CSRF_FIELD}
    if not all(is_choice(name, value) for name, value in fields.items()):
        raise RequestRefusedError(400, "error_form")
    messages = Messages(context.language(request))
    chosen = {
        name: messages.understood(value) if name.startswith("set.") or name == "trigger" else value
        for name, value in fields.items()
    }
    _enqueue_allowed(context)
    if chosen:  # nothing is chosen yet where it is read for the first time
        study.choices = {name: value for name, value in chosen.items() if value}
    context.studies.read(study)
    return _to(study)


async def run(context: PageContext, request: Request, _: BrowserSession, form: dict[str, str]) -> Response:
    """Have it studied: what was read is confirmed."""
    study = _study(context, request)
    try:
        goal = Goal(form.get("goal", ""))
    except ValueError as error:
        raise RequestRefusedError(400, "error_form") from error
    if study.stage not in (Stage.CONFIRMING, Stage.DONE) or study.is_working or study.faults:
        raise RequestRefusedError(409, "error_study_stage")
    _enqueue_allowed(context)
    context.studies.begin(study, goal)
    return _to(study)


async def study(context: PageContext, request: Request, session: BrowserSession) -> Response:
    """Show one study."""
    return _rendered(context, request, session, "study.html.j2")


async def study_state(context: PageContext, request: Request, session: BrowserSession) -> Response:
    """Show what changes of one study alone, for a page that brings itself up to date."""
    return _rendered(context, request, session, "_study.html.j2")


def _rendered(context: PageContext, request: Request, session: BrowserSession, template: str) -> Response:
    shown = _study(context, request)
    changed_since = context.studies.store.changed_since(shown)
    is_in_service = context.studies.store.is_in_service(shown)
    may_accept = session.actor.role >= Role.ENGINEER
    return context.page(
        request,
        template,
        session,
        study=shown,
        place=context.studies.place(shown),
        may_accept=may_accept and shown.can_be_accepted and not is_in_service,
        may_restore=may_accept and shown.can_be_restored and is_in_service,
        may_remove=_may_remove(shown, session),
        is_in_service=is_in_service,
        is_untold=not shown.is_accepted and is_untold(shown.changes.get("refused") or ""),
        changed_since=changed_since,
        differing=differing_parameters(shown.result, shown.changes),
        report=REPORTS.get(_report_language(context, request, shown), ""),
    )


def _report_language(context: PageContext, request: Request, study: Study) -> str:
    """Language in which the report is shown: that of the page where there is one; empty without a report."""
    there = [
        language
        for language, name in REPORTS.items()
        if (context.studies.store.results(study) / name).is_file()
    ]
    asked = context.language(request)
    return asked if asked in there else next(iter(there), "")


async def report(context: PageContext, request: Request, _: BrowserSession) -> Response:
    """Give the report, which may do nothing but show itself."""
    study = _study(context, request)
    language = _report_language(context, request, study) or next(iter(REPORTS))
    path = context.studies.store.results(study) / REPORTS[language]
    response = _file(path, "text/html; charset=utf-8")
    response.headers["content-security-policy"] = REPORT_POLICY
    return response


async def download(context: PageContext, request: Request, _: BrowserSession) -> Response:
    """Give a file of the result."""
    name = request.path_params["name"]
    if name not in DOWNLOADS:
        raise RequestRefusedError(404, "error_not_found")
    response = _file(
        context.studies.store.results(_study(context, request)) / name, "application/octet-stream"
    )
    response.headers["content-disposition"] = f'attachment; filename="{name}"'
    return response


async def accept(
    context: PageContext, request: Request, session: BrowserSession, _: dict[str, str]
) -> Response:
    """Put the extended model into service in the study's cell."""
    return await _change_model(context, request, session, "accept")


async def restore(
    context: PageContext, request: Request, session: BrowserSession, _: dict[str, str]
) -> Response:
    """Put the model back into service that was there before."""
    return await _change_model(context, request, session, "restore")


async def _change_model(
    context: PageContext, request: Request, session: BrowserSession, action: str
) -> Response:
    study = _study(context, request)
    extended = context.studies.store.results(study) / "model.extended.yaml"
    is_latest = context.studies.store.changed_since(study) is None
    if study.accepting or (is_latest and study.acceptances and study.acceptances[-1].action == action):
        return _to(study)  # somebody was faster, or pressed twice: its page says what was done
    if action == "restore" and study.is_accepted and not is_latest:
        return _to(study)  # the model from before is another one by now: its page says so
    if not (study.can_be_restored if action == "restore" else study.can_be_accepted):
        raise RequestRefusedError(409, "error_study_stage")
    study.accepting, study.refusals = action, []

    async def change() -> None:
        try:
            actor = session.actor
            if action == "accept":
                model = await context.backend.accept_model(study.cell, extended, actor)
            else:
                model = await context.backend.restore_model(study.cell, actor)
            done = Acceptance(action, actor.user, context.now_ms(), model)
            study.acceptances = [*study.acceptances, done]
        except RefusedError as error:
            study.refusals = str(error).splitlines()
        except Exception:  # noqa: BLE001 - whatever it was, who asked is told
            _log.exception("study %s: %s of the model of %s failed", study.id, action, study.cell)
            study.refusals = [PROGRAM_FAULT]
        finally:
            study.accepting = ""
            context.studies.store.save(study)

    context.beside(change())
    return _to(study)


async def remove(
    context: PageContext, request: Request, session: BrowserSession, _: dict[str, str]
) -> Response:
    """Forget a study; who began it may, and engineers."""
    study = _study(context, request)
    if not _may_remove(study, session):
        raise RequestRefusedError(403, "error_role")
    if study.accepting:
        raise RequestRefusedError(409, "error_study_stage")
    context.studies.forget(study)
    await asyncio.to_thread(context.studies.store.remove, study)
    return RedirectResponse("/studies", 303)


def _may_remove(study: Study, session: BrowserSession) -> bool:
    """Whether somebody began a study and may still begin one, or is an engineer."""
    role = session.actor.role
    return role >= Role.ENGINEER or (role >= Role.OPERATOR and study.user == session.actor.user)


def _enqueue_allowed(context: PageContext) -> None:
    if context.studies.is_full:
        raise RequestRefusedError(503, "error_queue_full")


def _study(context: PageContext, request: Request) -> Study:
    study = context.studies.store.find(request.path_params["study"])
    if study is None:
        raise RequestRefusedError(404, "error_not_found")
    return study


def _file(path: Path, media_type: str) -> Response:
    if not path.is_file():
        raise RequestRefusedError(404, "error_not_found")
    return FileResponse(path, media_type=media_type)


def _to(study: Study) -> Response:
    return RedirectResponse(f"/studies/{study.id}", 303)
