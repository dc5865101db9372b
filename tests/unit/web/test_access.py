"""Who may see and do what on the page: every address, every role, and all that must be refused."""

import asyncio
import math
import os
import re
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from impactcell.alarms import RULES, EventKind
from impactcell.records import Evidence, Shelving
from impactcell.records.uncertainty import TOLD_STDS
from impactcell.scada import Role
from impactcell.scada.users import User, read_users, write_users
from impactcell.web import system_page
from impactcell.web.app import ACTIONS, VIEWS, Action, View
from impactcell.web.cell_view import alarm_content
from impactcell.web.interface import CellNews, Freshness
from impactcell.web.requests import MAX_FORM_BYTES
from impactcell.web.security_headers import HEADERS
from impactcell.web.sessions import IDLE_S, LONGEST_S
from impactcell.web.studies.study import Acceptance, Stage, Study
from tests.unit.web.page import (
    ADDRESS,
    CELL,
    NAMES,
    PASSWORD,
    Page,
    acknowledgement,
    csrf_of,
    log_in,
    make_page,
    put,
    raised,
)

SHOWN = [view for view in VIEWS if not view.path.startswith("/live")]
"""The stream does not end by itself: it has tests of its own."""


STUDY = "known-study"


def address(path: str) -> str:
    return path.replace("{cell}", CELL).replace("{study}", STUDY).replace("{name}", "result.json")


@pytest.fixture
async def page(tmp_path: Path) -> AsyncIterator[Page]:
    """A page with a study that is done, and whose model could be accepted, or has been."""
    results = tmp_path / "studies" / STUDY / "results"
    results.mkdir(parents=True)
    for name in ("result.json", "report.html"):
        (results / name).write_text("{}")
    study = Study(STUDY, "shots.csv", NAMES[Role.OPERATOR], 0, CELL, Stage.DONE, files={"shots.csv": 1})
    study.result = {
        "verdict": "named",
        "headline": "Missing: it",
        "effects": [{"effect": "it", "parameters": {}}],
    }
    study.acceptances = [Acceptance("accept", "eva", 0, "with it")]
    (results.parent / "study.json").write_bytes(msgspec.json.encode(study))
    page = make_page(tmp_path)
    yield page
    await page.studies.close()


@pytest.mark.parametrize("view", VIEWS, ids=lambda view: view.path)
async def test_nobody_sees_anything_without_a_login(page: Page, view: View) -> None:
    async with page.client() as client:
        answer = await client.get(address(view.path))
    if view.is_page:
        assert answer.status_code == 303
        assert answer.headers["location"].startswith("/login?next=")
    else:
        assert answer.status_code == 401
    assert CELL not in answer.text


@pytest.mark.parametrize("action", ACTIONS, ids=lambda action: action.path)
async def test_nobody_does_anything_without_a_login(page: Page, action: Action) -> None:
    async with page.client() as client:
        answer = await client.post(address(action.path), data=acknowledgement(raised()))
    assert answer.status_code == 303
    assert answer.headers["location"] == "/login"
    assert not page.backend.acted
    assert not page.backend.trusted


@pytest.mark.parametrize("role", Role, ids=lambda role: role.name)
@pytest.mark.parametrize("view", SHOWN, ids=lambda view: view.path)
async def test_each_role_sees_what_it_may(page: Page, view: View, role: Role) -> None:
    async with page.logged_in(role) as client:
        answer = await client.get(address(view.path))
    without_journal = view.path.endswith("/trend")
    assert answer.status_code == (204 if without_journal else 200 if role >= view.role else 403)


@pytest.mark.parametrize("role", Role, ids=lambda role: role.name)
@pytest.mark.parametrize("action", ACTIONS, ids=lambda action: action.path)
async def test_each_role_does_what_it_may(page: Page, action: Action, role: Role) -> None:
    if action.path.endswith("/accept"):  # what is in service is not put there again
        for study in page.studies.store:
            study.acceptances = []
    async with page.logged_in(role) as client:
        form = {"thumbprint": "AB", "goal": "estimate", **acknowledgement(raised())}
        if action.path.endswith("/read"):  # takes no fields but its own
            form = {"column.force": "F"}
        form["csrf"] = await csrf_of(client)
        answer = await client.post(address(action.path), data=form)
        done = 201 if action.path == "/studies" else 303
        assert answer.status_code == (done if role >= action.role else 403)
        await asyncio.sleep(0)
    assert len(page.backend.acted) == (action.path == "/alarms/act" and role >= Role.OPERATOR)
    assert len(page.backend.trusted) == (action.path == "/system/trust" and role >= Role.ENGINEER)
    assert len(page.backend.replaced) == (action.path.endswith("/reset-wear") and role >= Role.ENGINEER)
    changes_model = action.path.endswith(("/accept", "/restore"))
    assert len(page.backend.changed) == (changes_model and role >= Role.ENGINEER)


@pytest.mark.parametrize("token", ["", "guess", None])
@pytest.mark.parametrize("action", ACTIONS, ids=lambda action: action.path)
async def test_a_form_without_its_token_is_refused(page: Page, action: Action, token: str | None) -> None:
    form = acknowledgement(raised()) | ({} if token is None else {"csrf": token})
    async with page.logged_in(Role.ENGINEER) as client:
        answer = await client.post(address(action.path), data=form)
        assert answer.status_code == 403
        assert (await client.get("/")).status_code == 200
    assert not page.backend.acted
    assert not page.backend.trusted


async def test_the_token_of_another_session_is_refused(page: Page) -> None:
    async with page.logged_in(Role.ENGINEER) as one, page.logged_in(Role.OPERATOR) as other:
        form = {"csrf": await csrf_of(one), **acknowledgement(raised())}
        assert (await other.post("/alarms/act", data=form)).status_code == 403
    assert not page.backend.acted


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "http://elsewhere.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:9999"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
    ids=str,
)
async def test_a_form_from_elsewhere_is_refused(page: Page, headers: dict[str, str]) -> None:
    async with page.logged_in(Role.OPERATOR) as client:
        form = {"csrf": await csrf_of(client), **acknowledgement(raised())}
        assert (await client.post("/alarms/act", data=form, headers=headers)).status_code == 403
    async with page.client() as client:
        data = {"user": NAMES[Role.OPERATOR], "password": PASSWORD}
        answer = await client.post("/login", data=data, headers=headers)
    assert answer.status_code == 403
    assert "set-cookie" not in answer.headers
    assert not page.backend.acted


async def test_a_form_of_this_page_is_taken(page: Page) -> None:
    alarm = raised()
    headers = {"origin": ADDRESS, "sec-fetch-site": "same-origin"}
    async with page.logged_in(Role.OPERATOR) as client:
        form = {"csrf": await csrf_of(client), **acknowledgement(alarm, comment=" looked at ")}
        answer = await client.post("/alarms/act", data=form, headers=headers)
    assert answer.headers["location"] == "/alarms"
    [(cell, name, action, actor)] = page.backend.acted
    assert (cell, name) == (CELL, alarm.name)
    assert action.event is EventKind.ACKNOWLEDGE
    assert action.event_id.hex() == acknowledgement(alarm)["event_id"]
    assert action.comment == "looked at"
    assert (actor.user, actor.role) == (NAMES[Role.OPERATOR], Role.OPERATOR)


@pytest.mark.parametrize("minutes", ["30", "long", "nan", ""])
async def test_minutes_are_for_shelving_alone(page: Page, minutes: str) -> None:
    """They hold up no other action, whatever a form sends."""
    events = {
        "acknowledge": EventKind.ACKNOWLEDGE,
        "comment": EventKind.COMMENT,
        "shelve": EventKind.SHELVE_TIMED,
    }
    async with page.logged_in(Role.OPERATOR) as client:
        form = {"csrf": await csrf_of(client), **acknowledgement(raised()), "minutes": minutes}
        for action in events:
            answer = await client.post("/alarms/act", data=form | {"action": action})
            assert answer.status_code == (400 if (action, minutes) == ("shelve", "long") else 303)
    done = {action.event: action.shelve_s for _, _, action, _ in page.backend.acted}
    shelved_s = done.pop(EventKind.SHELVE_TIMED, None)
    assert done == {events["acknowledge"]: 0.0, events["comment"]: 0.0}
    if minutes == "30":
        assert shelved_s == 1800.0


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"alarm": "NoSuchAlarm"}, 400),
        ({"action": "disable"}, 400),
        ({"event_id": "zz"}, 400),
        ({"action": "shelve", "minutes": "long"}, 400),
        ({"cell": "press-2"}, 404),
        ({"comment": "x" * MAX_FORM_BYTES}, 413),
    ],
    ids=lambda value: str(value)[:30],
)
async def test_a_form_that_makes_no_sense_is_refused(page: Page, change: dict[str, str], status: int) -> None:
    async with page.logged_in(Role.ENGINEER) as client:
        form = {"csrf": await csrf_of(client), **acknowledgement(raised()), **change}
        assert (await client.post("/alarms/act", data=form)).status_code == status
    assert not page.backend.acted


@pytest.mark.parametrize(
    ("content_type", "body", "status"),
    [
        ("application/json", b"{}", 415),
        ("multipart/form-data; boundary=x", b"--x--", 415),
        ("application/x-www-form-urlencoded", b"\xff\xfe", 400),
        ("application/x-www-form-urlencoded", b"&".join(b"a=1" for _ in range(100)), 400),
    ],
    ids=["json", "multipart", "not-utf-8", "many-fields"],
)
async def test_what_is_no_form_is_refused(page: Page, content_type: str, body: bytes, status: int) -> None:
    async with page.logged_in(Role.ENGINEER) as client:
        for path in ("/alarms/act", "/login"):
            answer = await client.post(path, content=body, headers={"content-type": content_type})
            assert answer.status_code == status


async def test_what_the_service_refuses_is_said(page: Page) -> None:
    page.backend.refuses = "BadConditionBranchAlreadyAcked"
    async with page.logged_in(Role.OPERATOR) as client:
        form = {"csrf": await csrf_of(client), **acknowledgement(raised())}
        answer = await client.post("/alarms/act", data=form)
        assert answer.headers["location"] == "/alarms?refused=BadConditionBranchAlreadyAcked"
        assert "somebody has acknowledged it already" in (await client.get(answer.headers["location"])).text


async def test_wrong_passwords_go_through_the_throttle_of_opc_ua(page: Page) -> None:
    async with page.client() as client:
        for user, password in (("eva", "wrong"), ("nobody", PASSWORD), ("", "")):
            answer = await log_in(client, user, password)
            assert answer.status_code == 401
            assert "set-cookie" not in answer.headers
    assert page.backend.logins == [("eva", "127.0.0.1"), ("nobody", "127.0.0.1"), ("", "127.0.0.1")]


async def test_the_cookie_is_for_this_page_alone(page: Page) -> None:
    async with page.client() as client:
        cookie = (await log_in(client, "eva", PASSWORD)).headers["set-cookie"]
    assert cookie.startswith("impactcell_8480=")
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie


@pytest.mark.parametrize(
    "after", ["//elsewhere.example", "http://elsewhere.example", "/\\elsewhere", "javascript:x", "/a\nb"]
)
async def test_the_login_leads_nowhere_else(page: Page, after: str) -> None:
    async with page.client() as client:
        assert (await log_in(client, "eva", PASSWORD, next=after)).headers["location"] == "/"


async def test_a_session_that_is_idle_ends(page: Page) -> None:
    async with page.logged_in(Role.ENGINEER) as client:
        page.clock.now += IDLE_S
        assert (await client.get("/")).status_code == 200
        page.clock.now += IDLE_S + 1
        assert (await client.get("/")).status_code == 303


@pytest.mark.slow
@pytest.mark.parametrize("role", Role)
async def test_a_session_in_use_ends_too(page: Page, role: Role) -> None:
    async with page.logged_in(role) as client:
        for _ in range(int(LONGEST_S[role] // IDLE_S)):
            page.clock.now += IDLE_S
            assert (await client.get("/live?cell=none")).status_code == 404
        page.clock.now += IDLE_S
        assert (await client.get("/")).status_code == 303


@pytest.mark.parametrize("change", ["removed", "role", "password"])
async def test_a_session_ends_with_its_user(page: Page, change: str) -> None:
    async with page.logged_in(Role.ENGINEER) as client:
        users = read_users(page.users)
        user = users.pop(NAMES[Role.ENGINEER])
        if change == "role":
            users[user.name] = replace(user, role=Role.OBSERVER)
        elif change == "password":
            users[user.name] = replace(user, password="another")
        write_users(page.users, users)
        assert (await client.get("/system")).status_code == 303


async def test_logging_out_ends_the_session(page: Page) -> None:
    async with page.logged_in(Role.OBSERVER) as client:
        token = client.cookies["impactcell_8480"]
        await client.post("/logout", data={"csrf": await csrf_of(client)})
        client.cookies["impactcell_8480"] = token
        assert (await client.get("/")).status_code == 303


@pytest.mark.parametrize("freshness", [Freshness.STARTING, Freshness.COMPILING])
async def test_a_cell_that_starts_has_lost_no_link(page: Page, freshness: Freshness) -> None:
    """The system page told of it in red, while the cell's own said that it starts."""
    async with page.logged_in(Role.OBSERVER) as client:
        page.feed.put(CellNews(CELL, freshness=freshness))
        starting = (await client.get("/system?lang=en")).text
        page.feed.put(CellNews(CELL, freshness=Freshness.LOST))
        lost = (await client.get("/system?lang=en")).text
    assert ("○ starting" in starting, "✕ no connection" in starting) == (True, False)
    assert ("○ starting" in lost, "✕ no connection" in lost) == (False, True)


async def test_users_and_certificates_are_shown_to_engineers_only(page: Page) -> None:
    for role in Role:
        async with page.logged_in(role) as client:
            text = (await client.get("/system")).text
        others = [name for other, name in NAMES.items() if other is not role]
        assert all((name in text) == (role is Role.ENGINEER) for name in others)


@pytest.mark.skipif(os.name != "posix", reason="modes tell of access on POSIX only")
async def test_files_open_to_others_are_shown_to_engineers_while_they_are(page: Page) -> None:
    """Only the log told of them, once at the service's start; an observer learns no path."""
    key = page.users.parent / "pki" / "key.pem"
    key.parent.mkdir()
    key.touch()
    page.users.chmod(0o666)
    key.chmod(0o644)
    for role in Role:
        async with page.logged_in(role) as client:
            english, german = [(await client.get(f"/system?lang={code}")).text for code in ("en", "de")]
        assert (f"can read and write the users file: <code>{page.users}</code>" in english) == (
            role is Role.ENGINEER
        )
        assert (str(key) in english) == (role is Role.ENGINEER)
    assert f"können die Benutzerdatei lesen und ändern: <code>{page.users}</code>" in german
    assert f"können den privaten Schlüssel lesen: <code>{key}</code>" in german
    assert f"Abhilfe: <code>chmod 600 {key}</code>" in german
    page.users.chmod(0o600)
    key.chmod(0o600)
    async with page.logged_in(Role.ENGINEER) as client:
        assert "chmod" not in (await client.get("/system")).text


async def test_an_observer_is_offered_nothing_to_do(page: Page) -> None:
    await put(page, CellNews(CELL, alarms=(raised(),)))
    for role in Role:
        async with page.logged_in(role) as client:
            text = (await client.get("/alarms")).text
        assert "friction is off" in text
        assert ('action="/alarms/act"' in text) == (role >= Role.OPERATOR)


async def test_what_stands_behind_plus_minus_is_said_where_it_is_read(page: Page) -> None:
    await put(page, CellNews(CELL, alarms=(raised(evidence=Evidence(12.0, 11.0, 4, 0.01, 0.002)),)))
    async with page.logged_in(Role.OBSERVER) as client:
        alarms = (await client.get("/alarms?lang=de")).text
        assert "Größe 0,0100 ± 0,0040" in alarms
        for path in ("/", f"/cells/{CELL}", "/alarms"):
            text = (await client.get(path)).text
            assert f'data-told-stds="{TOLD_STDS}"' in text
            assert "± sind 2 Standardabweichungen: mit etwa 95 % Sicherheit" in text


@pytest.mark.parametrize(
    ("name", "evidence", "english", "german"),
    [
        ("WearLimit", Evidence(1.0, 0.97), "Probability over 99.9 %, alarm above 97 %",
         "Wahrscheinlichkeit über 99,9 %, Alarm über 97 %"),
        ("WearWarning", Evidence(0.9312, 0.9), "Probability 93 %, alarm above 90 %",
         "Wahrscheinlichkeit 93 %, Alarm über 90 %"),
        ("DeviantCycle", Evidence(12.25, 11.0), "Evidence 12.2, alarm above 11",
         "Nachweis 12,2, Alarm über 11"),
        ("DeviantCycle", Evidence(12.25), "Evidence 12.2", "Nachweis 12,2"),
        ("DeviantCycle", Evidence(), "", ""),
    ],
)  # fmt: skip
async def test_a_probability_is_said_to_be_one(
    page: Page, name: str, evidence: Evidence, english: str, german: str
) -> None:
    alarm = replace(raised(evidence=evidence), name=name)
    assert alarm_content(CELL, alarm)["evidence"]["compared"] == {"en": english, "de": german}
    await put(page, CellNews(CELL, alarms=(alarm,)))
    async with page.logged_in(Role.OBSERVER) as client:
        for language, said in (("en", english), ("de", german)):
            text = (await client.get(f"/alarms?lang={language}")).text
            assert f"500. {said}</p>" in text


async def test_the_evidence_of_an_alarm_is_one_row_of_facts(page: Page) -> None:
    whole = Evidence(12.25, 11.0, change_cycle=70, size=0.0903, size_std=0.0028)
    for evidence, said in (
        (whole, "Evidence 12.2, alarm above 11, since cycle 70, size 0.0903 ± 0.0056"),
        (replace(whole, statistic=math.nan), "since cycle 70, size 0.0903 ± 0.0056"),
        (replace(whole, size_std=math.inf), "Evidence 12.2, alarm above 11, since cycle 70"),
    ):
        await put(page, CellNews(CELL, alarms=(replace(raised(evidence=evidence), name="DeviantCycle"),)))
        async with page.logged_in(Role.OBSERVER) as client:
            assert f"500. {said}</p>" in (await client.get("/alarms?lang=en")).text


@pytest.mark.parametrize("figure", [math.inf, -math.inf, math.nan, 0.0, 5e-324, 1e308])
async def test_an_alarm_is_shown_whatever_figures_it_has(page: Page, figure: float) -> None:
    alarms = [
        replace(raised(evidence=replace(evidence, **{name: figure})), name=rule)
        for rule in RULES
        for evidence in (Evidence(), Evidence(0.99, 0.9, 7, 0.1, 0.01))
        for name in ("statistic", "threshold", "size", "size_std")
    ]
    async with page.logged_in(Role.OPERATOR) as client:
        for alarm in alarms:
            await put(page, CellNews(CELL, alarms=(alarm,)))
            assert alarm_content(CELL, alarm)
            assert f'id="alarm-{CELL}-{alarm.name}"' in (await client.get("/alarms/rows")).text, alarm


def test_a_size_that_nothing_is_known_of_is_told_nowhere() -> None:
    """A cycle may be unlike the others over the whole slide, with no place and so no size that counts."""
    deviant = raised(evidence=Evidence(12.25, 11.0, 70, 0.0903, math.inf))
    assert alarm_content(CELL, deviant)["evidence"]["size"] is None


@pytest.mark.parametrize("path", ["/", "/alarms", "/studies", "/system", "/nothing"])
async def test_every_page_counts_the_open_alarms(page: Page, path: str) -> None:
    async with page.logged_in(Role.OBSERVER) as client:
        assert 'id="open-alarms" hidden>' in (await client.get(path)).text
        await put(page, CellNews(CELL, alarms=(raised(),)))
        assert 'id="open-alarms" aria-label="Open alarms: 1">1<' in (await client.get(path)).text
        await put(page, CellNews(CELL, alarms=(raised(shelving=Shelving.TIMED),)))
        assert 'id="open-alarms" hidden>' in (await client.get(path)).text


async def test_the_navigation_says_where_one_is_and_leads_back(page: Page) -> None:
    study = page.studies.store.begin("rail", "otto", CELL)
    for path, current, back in (
        ("/", '<a href="/" aria-current="page">Cells</a>', ""),
        (f"/cells/{CELL}", '<a href="/" aria-current="true">Cells</a>', '<p><a href="/">Cells</a></p>'),
        (f"/studies/{study.id}", '<a href="/studies" aria-current="true">Measurements</a>', ""),
    ):
        async with page.logged_in(Role.OBSERVER) as client:
            text = (await client.get(path)).text
        navigation = text[text.index("<nav") : text.index("</nav>")]
        assert current in navigation
        assert navigation.count("aria-current") == 1
        assert back in text


@pytest.mark.parametrize(
    ("language", "said"), [("en", "It said: friction is off"), ("de", "Gemeldet war: Reibung passt nicht")]
)
async def test_what_an_alarm_said_is_past_once_it_has_cleared(page: Page, language: str, said: str) -> None:
    for active in (True, False):
        alarm = replace(raised(message_de="Reibung passt nicht"), active=active)
        await put(page, CellNews(CELL, alarms=(alarm,)))
        async with page.logged_in(Role.OBSERVER) as client:
            text = (await client.get(f"/alarms?lang={language}")).text
        assert (f"<p>{said}</p>" in text) is not active
        assert ("○ cleared<" in text) is (language == "en" and not active)


@pytest.mark.parametrize(
    ("came_ms", "changed_ms", "said"),
    [
        (5000, 5000, "Raised <5000>, Cycle 7"),
        (5000, 9000, "Raised <5000>; last change <9000>, Cycle 7"),
        (0, 9000, "last change <9000>, Cycle 7"),  # of a version that did not keep when it came
    ],
)
async def test_an_open_alarm_says_when_it_came_and_when_it_changed_last(
    page: Page, came_ms: int, changed_ms: int, said: str
) -> None:
    alarm = replace(raised(activation=came_ms * 1_000_000), time_ns=changed_ms * 1_000_000)
    await put(page, CellNews(CELL, alarms=(alarm,)))
    async with page.logged_in(Role.OBSERVER) as client:
        text = (await client.get("/alarms/rows?lang=en")).text
    shown = re.sub(r'<time data-ms="(\d+)"></time>', r"<\1>", text)
    assert f'<p class="help">{said}, severity 500' in shown


async def test_a_cell_that_places_nothing_shows_no_positioning(page: Page) -> None:
    async with page.logged_in(Role.OBSERVER) as client:
        assert "<h2>Positioning</h2>" not in (await client.get(f"/cells/{CELL}")).text


async def test_wear_is_reset_by_an_engineer_and_a_refusal_is_said(page: Page) -> None:
    for role in Role:
        async with page.logged_in(role) as client:
            text = (await client.get(f"/cells/{CELL}")).text
            assert (f'action="/cells/{CELL}/reset-wear"' in text) == (role >= Role.ENGINEER)
            form = {"csrf": await csrf_of(client), "comment": " new plate "}
            answer = await client.post(f"/cells/{CELL}/reset-wear", data=form)
            assert answer.status_code == (303 if role >= Role.ENGINEER else 403)
            if role >= Role.ENGINEER:
                assert page.backend.replaced == [(CELL, "new plate", "eva")]
                assert (await client.post("/cells/none/reset-wear", data=form)).status_code == 404
                page.backend.refuses = "BadOutOfRange"
                answer = await client.post(f"/cells/{CELL}/reset-wear", data=form)
                assert "the comment is too long" in (await client.get(answer.headers["location"])).text
    assert len(page.backend.replaced) == 1


SCRIPT = '"><script>alert(1)</script><img src=x onerror=alert(2)>'


async def test_a_script_in_a_name_or_a_comment_is_text(tmp_path: Path) -> None:
    page = make_page(tmp_path)
    users = read_users(page.users)
    write_users(page.users, users | {SCRIPT: User(SCRIPT, Role.ENGINEER, password="x")})
    await put(
        page, CellNews(CELL, alarms=(raised(SCRIPT, comment=SCRIPT, user=SCRIPT, comment_user=SCRIPT),))
    )
    async with page.client() as client:
        assert SCRIPT not in (await log_in(client, SCRIPT, "wrong", next=SCRIPT)).text
        await log_in(client, SCRIPT, PASSWORD)
        for path in ("/", "/alarms", "/alarms/rows", "/system", f"/alarms?refused={SCRIPT}", f"/{SCRIPT}"):
            text = (await client.get(path)).text
            assert "<script>alert" not in text, path
            assert "<img src=x" not in text, path
    frame = page.feed.frame("card", CELL)
    assert frame.count(b"\n") == 3  # an event of one line: nothing in a text ends it


@pytest.mark.parametrize("path", ["/login", "/", "/nothing", "/live", "/static/none"])
async def test_every_answer_has_the_headers(page: Page, path: str) -> None:
    async with page.client() as client:
        answer = await client.get(path)
    assert {name: answer.headers.get(name) for name in HEADERS} == HEADERS
    assert answer.headers["cache-control"] == "no-store"
    assert "unsafe" not in HEADERS["content-security-policy"]


async def test_a_fault_of_the_page_is_said_in_a_page(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("a secret of the program")

    async with page.logged_in(Role.OBSERVER) as client:
        monkeypatch.setattr(system_page, "_cell_system", fail)
        monkeypatch.setattr(client._transport, "raise_app_exceptions", False)
        answer = await client.get("/system?lang=de")
    assert answer.status_code == 500
    assert "Zellen und OPC UA laufen weiter." in answer.text
    assert "secret" not in answer.text
    assert {name: answer.headers.get(name) for name in HEADERS} == HEADERS
    assert answer.headers["cache-control"] == "no-store"


async def test_other_methods_are_refused(page: Page) -> None:
    async with page.logged_in(Role.ENGINEER) as client:
        for view in SHOWN:
            allowed = {"POST"} if view.path in {action.path for action in ACTIONS} else set()
            for method in {"POST", "PUT", "DELETE"} - allowed:
                assert (await client.request(method, address(view.path))).status_code == 405
        for action in ACTIONS:
            if action.path not in {view.path for view in VIEWS}:
                assert (await client.get(address(action.path))).status_code == 405
