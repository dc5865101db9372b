"""Measurements that are dropped: received within limits, studied one after the other, shown without harm."""

import asyncio
import csv
import io
import json
import re
import shutil
import statistics
import threading
import zipfile
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Any

import httpx
import msgspec
import pytest

from impactcell.campaign import read
from impactcell.errors import CampaignError
from impactcell.process.background import VerbOutcome
from impactcell.scada import Role
from impactcell.web.studies import campaign_archive, pages, queue, upload
from impactcell.web.studies.campaign_archive import unpack_campaign
from impactcell.web.studies.pages import REPORT_POLICY
from impactcell.web.studies.queue import MAX_WAITING
from impactcell.web.studies.study import Acceptance, Stage, Study, StudyStore
from impactcell.web.studies.upload import safe_name
from tests.patience import PATIENCE_S
from tests.unit.web.page import CELL, Page, Verbs, csrf_of, make_page

RESULT = {
    "verdict": "named",
    "headline": "Missing: viscous friction.",
    "effects": [
        {
            "effect": "viscous_friction",
            "meaning": "Friction grows with speed.",
            "look_at": "the <oil>",
            "tied_with": ["quadratic_drag"],
            "parameters": {"c": {"value": 60.1, "ci95": [57.0, 63.0]}},
        }
    ],
    "model": "model.extended.yaml",
}
CHANGES = {"before": "old", "after": "new", "changes": [{"parameter": "mu_s", "before": 0.2, "after": 0.21}]}


def campaign_zip(below: str = "", **extra: bytes) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr(f"{below}campaign.yaml", "format: 1\n")
        packed.writestr(f"{below}shots.csv", "shot,velocity_mm_per_min,mass_kg\n1,4000,2.5\n2,5000,3\n")
        for shot in (1, 2):
            packed.writestr(f"{below}traces/{shot}.csv", "time_s,force_n,position_m\n0,0,0\n")
        for name, data in extra.items():
            packed.writestr(name.replace("__", "/"), data)
    return content.getvalue()


@pytest.fixture
def verbs() -> Verbs:
    return Verbs(
        {
            "discrepancy": VerbOutcome(0, json.dumps(RESULT), ()),
            "model": VerbOutcome(0, json.dumps(CHANGES), ()),
        }
    )


@pytest.fixture
async def page(tmp_path: Path, verbs: Verbs) -> AsyncIterator[Page]:
    page = make_page(tmp_path, verbs=verbs)
    yield page
    await page.studies.close()


async def drop(
    client: httpx.AsyncClient, name: str, data: bytes, *, cell: str = CELL, read: bool = True
) -> tuple[str, httpx.Response]:
    """Do what the script does: begin a study, send a file, have it read."""
    csrf = await csrf_of(client)
    begun = await client.post("/studies", data={"csrf": csrf, "cell": cell, "title": name})
    study: str = begun.json()["id"]
    answer = await client.put(
        f"/studies/{study}/files", params={"name": name}, content=data, headers={"x-csrf-token": csrf}
    )
    if answer.status_code == 201 and read:
        assert (await client.post(f"/studies/{study}/read", data={"csrf": csrf})).status_code == 303
    return study, answer


async def until(page: Page, study: str, *stages: Stage) -> Study:
    async with asyncio.timeout(PATIENCE_S):
        while True:
            found = page.studies.store.find(study)
            assert found is not None
            if found.stage in stages and not found.is_working:
                return found
            await asyncio.sleep(0.005)


async def investigated(page: Page, client: httpx.AsyncClient) -> tuple[str, dict[str, str]]:
    """Study of a campaign whose discrepancy has been looked for, and what a form of it has to bring."""
    study, _ = await drop(client, "shots.zip", campaign_zip())
    await until(page, study, Stage.CONFIRMING)
    csrf = {"csrf": await csrf_of(client)}
    await client.post(f"/studies/{study}/run", data=csrf | {"goal": "discrepancy"})
    await until(page, study, Stage.DONE)
    return study, csrf


async def test_what_was_read_is_shown_whole_or_not_at_all(
    page: Page, verbs: Verbs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page brings itself up to date while the campaign that `import` wrote is still being looked at."""
    looking, go_on = threading.Event(), threading.Event()

    def look(_: Path) -> dict[str, Any]:
        looking.set()
        go_on.wait(PATIENCE_S)
        return {"shots": 2, "traces": 2, "channels": [], "covariates": [], "mass_kg": None,
                "velocity_mm_per_min": None}  # fmt: skip

    monkeypatch.setattr(queue, "campaign_overview", look)
    verbs.outcomes["import"] = VerbOutcome(0, json.dumps({"shots": 2, "columns": [], "notes": []}), ())
    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "log.csv", b"t;F\n0;1\n")
        assert await asyncio.to_thread(looking.wait, PATIENCE_S)
        meanwhile = await client.get(f"/studies/{study}/state")
        go_on.set()
        await until(page, study, Stage.CONFIRMING)
        then = await client.get(f"/studies/{study}/state")
    assert (meanwhile.status_code, then.status_code) == (200, 200)
    assert "2 shots" not in meanwhile.text
    assert "2 shots" in then.text


async def test_a_campaign_is_dropped_confirmed_and_studied(page: Page, verbs: Verbs) -> None:
    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "shots.zip", campaign_zip("tuesday/"))
        found = await until(page, study, Stage.CONFIRMING)
        assert found.overview["shots"] == 2
        text = (await client.get(f"/studies/{study}")).text
        assert "2 shots, 2.5–3 kg, 4000–5000 mm/min" in text
        assert "force_n [N]" in text
        assert verbs.asked == []
        data = {"csrf": await csrf_of(client), "goal": "discrepancy"}
        assert (await client.post(f"/studies/{study}/run", data=data)).status_code == 303
        found = await until(page, study, Stage.DONE)
        text = (await client.get(f"/studies/{study}")).text
    assert [arguments[0] for arguments in verbs.asked] == ["discrepancy", "model"]
    assert verbs.asked[0][-3:] == [
        "--title=shots.zip",
        "--cell",
        str(page.users.parent / "press-1.yaml"),
    ]
    assert [name for name, _ in found.steps] == [
        "discrepancy",
        "doing discrepancy",
        "model accept",
        "doing model",
    ]
    assert "Missing: viscous friction." in text
    assert 'data-effect="viscous_friction"' in text
    assert "Friction grows with speed." in text
    assert "the &lt;oil&gt;" in text
    assert 'cannot tell it from:<ul><li data-tied="quadratic_drag">Quadratic drag</li></ul>' in text
    assert '<td data-label="Parameter">µs</td>' in text
    assert "/accept" not in text, "an operator accepts nothing"


async def test_what_speaks_against_the_model_is_told_before_anybody_accepts_it(
    page: Page, verbs: Verbs
) -> None:
    refused = (
        f"{CELL}: model oil is not put into service (--anyway would): of the cell's last 30 taps it leaves "
        "2.3 times the sensors' noise, 30 estimates are usable; the model before leaves 1 times the sensors' "
        "noise, 30 are"
    )
    told = CHANGES | {"refused": refused, "shared_with": ["press-2"]}
    verbs.outcomes["model"] = VerbOutcome(1, json.dumps(told), (refused,))
    async with page.logged_in(Role.ENGINEER) as client:
        study, _ = await investigated(page, client)
        shown = {code: (await client.get(f"/studies/{study}?lang={code}")).text for code in ("en", "de")}
        page.studies.store.find(study).changes = CHANGES  # type: ignore[union-attr]
        free = (await client.get(f"/studies/{study}?lang=en")).text
    assert "<button>Accept: put it into service</button>" in free
    assert "Accept: put it into service" not in shown["en"]
    assert '<button class="quiet">Judge again; accept if nothing speaks against it</button>' in shown["en"]
    assert (
        '<button class="quiet">Neu beurteilen; annehmen, wenn nichts dagegen spricht</button>' in shown["de"]
    )
    assert "Once that is put right, or new taps are there, ask again." in shown["en"]
    assert "the cell&#39;s own taps speak against it" in shown["en"]
    assert "die eigenen Stöße der Zelle sprechen dagegen" in shown["de"]
    assert "take this model too: press-2" in shown["en"]
    assert "dieses Modell auch nehmen: press-2" in shown["de"]
    assert "Missing: viscous friction." in shown["en"]


async def test_verdict_and_caution_stand_beside_a_model_before_and_after_it_is_accepted(
    page: Page, verbs: Verbs
) -> None:
    """`model accept` told them, and the page, on which most models are accepted, did not."""
    caution = "something remains that no established effect explains: 12% of the held-out gap, in loading"
    verbs.outcomes["model"] = VerbOutcome(
        0, json.dumps(CHANGES | {"verdict": "tied", "caution": caution}), ()
    )
    async with page.logged_in(Role.ENGINEER) as client:
        study, csrf = await investigated(page, client)
        for _ in range(2):
            english, german = [
                (await client.get(f"/studies/{study}?lang={code}")).text for code in ("en", "de")
            ]
            assert "but the data do not tell some of the names apart." in english
            assert f'<b lang="en">Caution:</b> {caution}</p>' in english
            assert "manche der Namen unterscheiden diese Daten aber nicht." in german
            assert '<b lang="de">Vorsicht:</b> Es bleibt etwas, das kein nachgewiesener' in german
            await client.post(f"/studies/{study}/accept", data=csrf)
            await until(page, study, Stage.DONE)
        assert "Put into service" in english
        assert "The model is calibrated first." not in english


async def test_a_model_whose_contact_nothing_tells_is_not_to_be_asked_for_again(
    page: Page, verbs: Verbs
) -> None:
    """Judging again was offered, which no cycle and no day makes another judgement of."""
    refused = (
        f"{CELL}: model oil is not put into service (`impactcell model accept C M --anyway` would): what it "
        "was found in does not tell k 21000 ± 5e+10 N/m (± is 95 %), and with such a prior each tap is "
        "fitted as if nothing were known; record taps over more velocities"
    )
    verbs.outcomes["model"] = VerbOutcome(1, json.dumps(CHANGES | {"refused": refused}), (refused,))
    async with page.logged_in(Role.ENGINEER) as client:
        study, _ = await investigated(page, client)
        english, german = [(await client.get(f"/studies/{study}?lang={code}")).text for code in ("en", "de")]
    assert "do not tell k 21000" in english
    assert "Asking again changes nothing: other measurements are needed, dropped as" in english
    assert "Neu fragen ändert nichts: es braucht andere Messungen, abgelegt" in german
    assert f'action="/studies/{study}/accept"' not in english
    assert "The model is calibrated first." not in english


@pytest.mark.parametrize(("verdict", "is_said"), [("unknown", True), ("untested", True), ("no_gap", False)])
async def test_that_there_is_no_model_is_said_where_nothing_was_established(
    page: Page, verbs: Verbs, verdict: str, is_said: bool
) -> None:
    result = {"verdict": verdict, "headline": "No known effect.", "effects": [], "model": "m"}
    verbs.outcomes["discrepancy"] = VerbOutcome(0, json.dumps(result), ())
    async with page.logged_in(Role.ENGINEER) as client:
        study, _ = await investigated(page, client)
        shown = (await client.get(f"/studies/{study}?lang=en")).text
    assert ("there is no model to put into service" in shown) is is_said


@pytest.mark.parametrize("effects", [[], ["viscous_friction"]])
async def test_a_force_on_a_part_of_unknown_mass_says_so_beside_its_figure(
    page: Page, verbs: Verbs, effects: list[str]
) -> None:
    verbs.outcomes["discrepancy"] = VerbOutcome(0, json.dumps(RESULT | {"per_kilogram": effects}), ())
    async with page.logged_in(Role.ENGINEER) as client:
        study, _ = await investigated(page, client)
        for language, said in (("en", "for a part of 1 kg"), ("de", "für ein Teil von 1 kg")):
            shown = (await client.get(f"/studies/{study}?lang={language}")).text
            assert (said in shown) is bool(effects)


async def test_an_engineer_accepts_and_takes_back(page: Page) -> None:
    async with page.logged_in(Role.ENGINEER) as client:
        study, _ = await drop(client, "shots.zip", campaign_zip())
        await until(page, study, Stage.CONFIRMING)
        csrf = {"csrf": await csrf_of(client)}
        assert (await client.post(f"/studies/{study}/accept", data=csrf)).status_code == 409
        await client.post(f"/studies/{study}/run", data=csrf | {"goal": "discrepancy"})
        await until(page, study, Stage.DONE)
        assert (await client.post(f"/studies/{study}/restore", data=csrf)).status_code == 409
        for action, undone in (("accept", "/restore"), ("restore", "/accept")):
            assert (await client.post(f"/studies/{study}/{action}", data=csrf)).status_code == 303
            await until(page, study, Stage.DONE)
            assert f'action="/studies/{study}{undone}"' in (await client.get(f"/studies/{study}/state")).text
        page.backend.refuses = "part would not slide"
        await client.post(f"/studies/{study}/accept", data=csrf)
        found = await until(page, study, Stage.DONE)
    assert page.backend.changed == [(CELL, "model.extended.yaml", "eva"), (CELL, "", "eva")]
    assert [done.action for done in found.acceptances] == ["accept", "restore"]
    assert found.refusals == ["part would not slide"]


async def test_what_is_pressed_twice_or_by_two_people_is_done_once_and_tells_no_fault(page: Page) -> None:
    """The second press got a page that said that it did not work, while it was being done."""
    async with page.logged_in(Role.ENGINEER) as client, page.logged_in(Role.ENGINEER) as other:
        study, csrf = await investigated(page, client)
        page.backend.held = asyncio.Event()
        theirs = {"csrf": await csrf_of(other)}
        for who, form in ((client, csrf), (other, theirs), (client, csrf)):
            answer = await who.post(f"/studies/{study}/accept", data=form)
            assert (answer.status_code, answer.headers["location"]) == (303, f"/studies/{study}")
        page.backend.held.set()
        await until(page, study, Stage.DONE)
        for action in ("accept", "restore", "restore"):
            assert (await other.post(f"/studies/{study}/{action}", data=theirs)).status_code == 303
            found = await until(page, study, Stage.DONE)
    assert page.backend.changed == [(CELL, "model.extended.yaml", "eva"), (CELL, "", "eva")]
    assert [done.action for done in found.acceptances] == ["accept", "restore"]


async def test_undoing_is_not_offered_where_another_model_came_since(page: Page) -> None:
    """It would have put back the model that the other measurement's had replaced: its own."""
    async with page.logged_in(Role.ENGINEER) as client:
        (first, csrf), (second, _) = [await investigated(page, client) for _ in range(2)]
        for now_ms, study in enumerate((first, second), 1):
            await client.post(f"/studies/{study}/accept", data=csrf)
            found = await until(page, study, Stage.DONE)
            found.acceptances = [msgspec.structs.replace(found.acceptances[0], time_ms=now_ms)]
        shown = {code: (await client.get(f"/studies/{first}?lang={code}")).text for code in ("en", "de")}
        last = (await client.get(f"/studies/{second}")).text
        listed = {code: (await client.get(f"/studies?lang={code}")).text for code in ("en", "de")}
        changed = list(page.backend.changed)
        assert (await client.post(f"/studies/{first}/restore", data=csrf)).status_code == 303
        assert page.backend.changed == changed
    assert "/restore" not in shown["en"]
    assert f'action="/studies/{first}/accept"' in shown["en"]
    assert f'changed by another measurement: <a href="/studies/{second}">' in shown["en"]
    assert "hat eine andere Messung das Modell dieser Zelle geändert" in shown["de"]
    assert f'action="/studies/{second}/restore"' in last
    assert "another measurement" not in last
    for language, said in (("en", "done, its model is in service"), ("de", "fertig, Modell in Betrieb")):
        assert listed[language].count(said) == 1
        assert listed[language].index(said) > listed[language].index(f"/studies/{second}")


async def test_who_may_not_accept_or_remove_is_not_offered_it(page: Page) -> None:
    """An operator was offered to remove the measurements of others, and told that engineers could accept
    what was in service already."""
    operator = page.logged_in(Role.OPERATOR)
    async with page.logged_in(Role.ENGINEER) as client, operator as other:
        study, csrf = await investigated(page, client)
        before = (await other.get(f"/studies/{study}")).text
        await client.post(f"/studies/{study}/accept", data=csrf)
        await until(page, study, Stage.DONE)
        after = (await other.get(f"/studies/{study}")).text
        assert f'action="/studies/{study}/remove"' in (await client.get(f"/studies/{study}")).text
    assert "/remove" not in before
    assert "Engineers can put it into service." in before
    assert "Engineers can put it into service." not in after
    assert "Put into service" in after


async def test_strengths_of_what_cannot_be_told_apart_are_said_with_their_units(
    page: Page, verbs: Verbs
) -> None:
    """Of a rotation the German page said "viscous coefficient n m s per rad", and of rivals no strength."""
    effect = {
        "effect": "viscous_friction",
        "tied_with": ["coulomb_friction", "load_dependent_friction"],
        "parameters": {"viscous_coefficient_n_m_s_per_rad": {"value": 0.0198, "ci95": [0.0171, 0.0225]}},
        "tied_parameters": {
            "coulomb_friction": {"friction_n_m": {"value": 0.0723, "ci95": [0.0627, 0.0819]}},
            "load_dependent_friction": {"load_coefficient": {"value": 0.00576, "ci95": [0.005, 0.0065]}},
        },
    }
    verbs.outcomes["discrepancy"] = VerbOutcome(0, json.dumps(RESULT | {"effects": [effect]}), ())
    async with page.logged_in(Role.ENGINEER) as client:
        study, _ = await investigated(page, client)
        shown = {code: (await client.get(f"/studies/{study}?lang={code}")).text for code in ("en", "de")}
    assert "viscous coefficient 0.0198 N m s/rad (95 %: 0.0171 to 0.0225)" in shown["en"]
    assert "viskoser Koeffizient 0,0198 N m s/rad (95 %: 0,0171 bis 0,0225)" in shown["de"]
    assert "Coulomb friction · friction 0.0723 N m (95 %: 0.0627 to 0.0819)</li>" in shown["en"]
    assert "unterscheiden es nicht von:<ul>" in shown["de"]
    assert "Lastabhängige Reibung · Lastbeiwert 0,00576 (95 %: 0,005 bis 0,0065)</li>" in shown["de"]


async def test_a_model_that_is_refused_leaves_the_study_as_it_was(page: Page, verbs: Verbs) -> None:
    refused = f"{CELL}: part would not slide"
    verbs.outcomes["model"] = VerbOutcome(1, json.dumps(CHANGES | {"refused": refused}), (refused,))
    async with page.logged_in(Role.ENGINEER) as client:
        study, csrf = await investigated(page, client)
        page.backend.refuses = refused
        await client.post(f"/studies/{study}/accept", data=csrf)
        await until(page, study, Stage.DONE)
        text = (await client.get(f"/studies/{study}/state")).text
        assert text.count("part would not slide") == 1
        assert f'action="/studies/{study}/run"' in text
        assert (
            await client.post(f"/studies/{study}/run", data=csrf | {"goal": "discrepancy"})
        ).status_code == 303
        await until(page, study, Stage.DONE)
        page.backend.refuses = ""
        assert (await client.post(f"/studies/{study}/accept", data=csrf)).status_code == 303
        found = await until(page, study, Stage.DONE)
    assert (found.refusals, [done.action for done in found.acceptances]) == ([], ["accept"])


async def test_a_fault_while_a_model_is_accepted_is_told(
    page: Page, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def fail(*_: object) -> str:
        raise ZeroDivisionError

    monkeypatch.setattr(page.backend, "accept_model", fail)
    study = page.studies.store.begin("rail", "otto", CELL)
    study.stage, study.result, study.changes = Stage.DONE, dict(RESULT), dict(CHANGES)
    async with page.logged_in(Role.ENGINEER) as client:
        await client.post(f"/studies/{study.id}/accept", data={"csrf": await csrf_of(client)})
        await until(page, study.id, Stage.DONE)
        shown = {code: (await client.get(f"/studies/{study.id}?lang={code}")).text for code in ("en", "de")}
    assert "a fault of this program; its log has it" in shown["en"]
    assert "ein Fehler dieses Programms; sein Log enthält ihn" in shown["de"]
    assert f"study {study.id}: accept of the model of {CELL} failed" in caplog.text
    assert "ZeroDivisionError" in caplog.text


def write_model(arguments: Sequence[str]) -> None:
    """Leave what `discrepancy` does."""
    if arguments[0] == "discrepancy":
        results = Path(arguments[arguments.index("-o") + 1])
        for name in ("model.extended.yaml", "report.html"):
            (results / name).write_text("of this run")


async def test_what_came_out_goes_when_the_files_are_read_again(page: Page, verbs: Verbs) -> None:
    verbs.on_run = write_model
    async with page.logged_in(Role.ENGINEER) as client:
        study, _ = await drop(client, "shots.zip", campaign_zip())
        found = await until(page, study, Stage.CONFIRMING)
        csrf = {"csrf": await csrf_of(client)}
        await client.post(f"/studies/{study}/run", data=csrf | {"goal": "discrepancy"})
        await until(page, study, Stage.DONE)
        assert "Missing: viscous friction." in (await client.get(f"/studies/{study}")).text
        assert (page.studies.store.results(found) / "model.extended.yaml").is_file()
        assert (await client.post(f"/studies/{study}/read", data=csrf)).status_code == 303
        kept = (found.result, found.changes, page.studies.store.results(found).exists())
        assert kept == ({}, {}, False), "from the moment on at which it waits to be read"
        assert (await client.post(f"/studies/{study}/accept", data=csrf)).status_code == 409
        await until(page, study, Stage.CONFIRMING)
        for address in (f"/studies/{study}", f"/studies/{study}/state", "/studies"):
            text = (await client.get(address)).text
            assert "Missing: viscous friction." not in text
            assert "/accept" not in text
        assert (await client.get(f"/studies/{study}/report")).status_code == 404
        assert (await client.post(f"/studies/{study}/accept", data=csrf)).status_code == 409
    assert page.backend.changed == []


@pytest.mark.parametrize("stage", [stage for stage in Stage if stage is not Stage.DONE])
async def test_nothing_is_accepted_but_what_came_out_last(page: Page, stage: Stage) -> None:
    async with page.logged_in(Role.ENGINEER) as client:
        study = page.studies.store.begin("rail", "otto", CELL)
        study.stage, study.result, study.changes = stage, dict(RESULT), dict(CHANGES)
        assert "/accept" not in (await client.get(f"/studies/{study.id}")).text
        csrf = {"csrf": await csrf_of(client)}
        assert (await client.post(f"/studies/{study.id}/accept", data=csrf)).status_code == 409
    assert page.backend.changed == []


async def test_what_was_accepted_can_be_taken_back_after_another_reading(page: Page) -> None:
    async with page.logged_in(Role.ENGINEER) as client:
        study, csrf = await investigated(page, client)
        await client.post(f"/studies/{study}/accept", data=csrf)
        await until(page, study, Stage.DONE)
        await client.post(f"/studies/{study}/read", data=csrf)
        await until(page, study, Stage.CONFIRMING)
        text = (await client.get(f"/studies/{study}")).text
        assert f'action="/studies/{study}/restore"' in text
        assert "Put into service: extended, eva" in text
        assert "old → <b>new</b>" not in text
        assert (await client.post(f"/studies/{study}/restore", data=csrf)).status_code == 303
        await until(page, study, Stage.CONFIRMING)
        assert "/restore" not in (await client.get(f"/studies/{study}")).text
    assert page.backend.changed == [(CELL, "model.extended.yaml", "eva"), (CELL, "", "eva")]


async def test_friction_of_each_shot(page: Page, verbs: Verbs) -> None:
    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "shots.zip", campaign_zip(), cell="")
        await until(page, study, Stage.CONFIRMING)
        rows = [
            {
                "shot": n,
                "mu_s": 0.2 + 0.01 * n,
                "mu_s_std": 0.001,
                "mu_k": "",
                "mu_k_std": "",
                "quality": "good",
                "reason": "",
            }
            for n in (1, 2)
        ]
        doubtful = {"quality": "uncertain", "reason": "mu_s 0.3183 is outside the calibrated 0.15-0.26"}
        rows += [
            rows[0] | {"shot": n, "mu_s": 0.3183, "mu_k": 0.1523412, "mu_k_std": 0.0006} | doubtful
            for n in range(3, 250)
        ]

        def write(arguments: Sequence[str]) -> None:
            with Path(arguments[arguments.index("-o") + 1]).open("w", newline="") as file:
                writer = csv.DictWriter(file, rows[0])
                writer.writeheader()
                writer.writerows(rows)

        verbs.on_run = write
        noted = (
            "mu_k goes with direction: 0.1597 ± 0.0016 in 6 shots along +1, 0.1445 ± 0.0012 in 7 shots along "
            "-1: friction differs by direction, "
            "or the surface is not level; a mean of both is that of neither"
        )
        verbs.outcomes["estimate"] = VerbOutcome(0, "", ("plant fitted to 13 of 13 shots", noted))
        await client.post(f"/studies/{study}/run", data={"csrf": await csrf_of(client), "goal": "estimate"})
        found = await until(page, study, Stage.DONE)
        values = [float(row["mu_s"]) for row in rows]
        expected = {"mean": statistics.mean(values), "spread": statistics.stdev(values), "n": len(values)}
        assert found.result["mu_s"] == pytest.approx(expected, rel=1e-6)
        text = (await client.get(f"/studies/{study}")).text
        assert "<td>0.2200</td>" in text
        assert "<td>0.0020</td>" in text, "two standard deviations behind ±; the file has one"
        assert "µs 0.3183 is outside the calibrated" in text
        assert "200/249 shots are shown" in text
        assert f'lang="en">{noted}' in text
        german = (await client.get(f"/studies/{study}?lang=de")).text
        assert "<td>0,3183</td><td>0,0020</td><td>0,1523</td><td>0,0012</td>" in german
        assert "unsicher: µs 0,3183 liegt außerhalb des Kalibrierten" in german
        assert 'lang="de">µk hängt von der Richtung ab: 0,1597 ± 0,0016 in 6 Aufzeichnungen' in german
        assert 'lang="en">plant fitted to' in german
        assert (await client.get(f"/studies/{study}/files/friction.csv")).text.startswith("shot,")
    assert "--cell" not in verbs.asked[0]


async def test_faults_of_a_verb_are_shown_with_their_rows(page: Page, verbs: Verbs) -> None:
    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "run.csv", b"a,b\n1,x\n", read=False)
        place = page.studies.store.files(page.studies.store.find(study))  # type: ignore[arg-type]
        columns = [{"column": "<a>", "quantity": "force", "unit": None, "why": "?", "confidence": 0.2}]
        understood = json.dumps({"columns": columns, "faults": ["no unit"]})
        verbs.outcomes["import"] = VerbOutcome(
            2, understood, (f"{place}/run.csv:2: 'x' is no number", "<b>&</b>")
        )
        await client.post(f"/studies/{study}/read", data={"csrf": await csrf_of(client)})
        await until(page, study, Stage.CONFIRMING)
        text = (await client.get(f"/studies/{study}")).text
        assert '<li lang="en">run.csv:2: &#39;x&#39; is no number</li>' in text
        assert ">not readable yet</span>" in text
        assert "run.csv (8 B)" in text
        assert 'name="set.rate"' in text
        assert ">noch nicht lesbar</td>" in (await client.get("/studies?lang=de")).text
        assert "&lt;b&gt;&amp;&lt;/b&gt;" in text
        assert "<code>&lt;a&gt;</code>" in text
        assert 'name="unit.&lt;a&gt;"' in text
        answer = await client.post(
            f"/studies/{study}/run", data={"csrf": await csrf_of(client), "goal": "estimate"}
        )
        assert answer.status_code == 409
        choices = {"csrf": await csrf_of(client), "column.force": "a", "unit.a": "kN", "set.mass": "2 kg"}
        await client.post(f"/studies/{study}/read", data=choices)
        await until(page, study, Stage.CONFIRMING)
    assert verbs.asked[-1][-3:] == ["--column=force=a", "--unit=a=kN", "--set=mass=2 kg"]


@pytest.mark.parametrize(
    ("language", "typed", "understood"),
    [("de", "18,9 kg", "18.9 kg"), ("de", "18.9 kg", "18.9 kg"), ("en", "18,900 kg", "18,900 kg")],
)
async def test_a_mass_is_read_as_the_language_of_the_page_writes_it(
    page: Page, verbs: Verbs, language: str, typed: str, understood: str
) -> None:
    columns = [{"column": "Zeit, ms", "quantity": "time", "unit": "ms", "why": "?", "confidence": 0.2}]
    verbs.outcomes["import"] = VerbOutcome(2, json.dumps({"columns": columns, "faults": ["no mass"]}), ())
    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "run.csv", b"t;F\n0;1\n")
        await until(page, study, Stage.CONFIRMING)
        choices = {"csrf": await csrf_of(client), "set.mass": typed, "column.time": "Zeit, ms"}
        await client.post(f"/studies/{study}/read?lang={language}", data=choices)
        await until(page, study, Stage.CONFIRMING)
        text = (await client.get(f"/studies/{study}?lang={language}")).text
    assert verbs.asked[-1][-2:] == [f"--set=mass={understood}", "--column=time=Zeit, ms"]
    assert f'name="set.mass" value="{"18,9 kg" if language == "de" else typed}"' in text
    assert f'placeholder="{"18,9 kg" if language == "de" else "18.9 kg"}"' in text


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("output", "{dir}/elsewhere"),
        ("mapping", "{dir}/any.yaml"),
        ("gain", "force=2 N/V"),
        ("json", "1"),
        ("dry-run", "1"),
        ("column", "force=F"),
        ("column.", "F"),
        ("trigger.force", "5 N"),
        ("output.x", "{dir}/elsewhere"),
        ("-o", "{dir}/elsewhere"),
        ("column.force", "a\0b"),
        ("column.a\0b", "F"),
    ],
)
async def test_only_what_the_form_asks_for_says_how_files_are_read(
    page: Page, verbs: Verbs, tmp_path: Path, field: str, value: str
) -> None:
    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "run.csv", b"t;F\n0;1\n", cell="")
        await until(page, study, Stage.CONFIRMING, Stage.FAILED)
        asked = len(verbs.asked)
        form = {"csrf": await csrf_of(client), "column.force": "F", field: value.format(dir=tmp_path)}
        answer = await client.post(f"/studies/{study}/read", data=form)
        found = await until(page, study, Stage.CONFIRMING, Stage.FAILED)
        assert (answer.status_code, found.choices, len(verbs.asked)) == (400, {}, asked)
        assert "This form cannot be read." in answer.text
        form = {"csrf": form["csrf"], "trigger": "-o", "set.mass": "--output=/x", "column.-o": "--mapping"}
        assert (await client.post(f"/studies/{study}/read", data=form)).status_code == 303
        await until(page, study, Stage.CONFIRMING, Stage.FAILED)
    assert verbs.asked[-1][-3:] == ["--trigger=-o", "--set=mass=--output=/x", "--column=-o=--mapping"]


async def test_files_are_read_in_the_order_of_their_numbers(page: Page, verbs: Verbs) -> None:
    """However they arrive: rows of `shots.csv` are the order in which the shots were taken."""
    names = ["shot10.csv", "shot2.csv", "shot12.csv", "shot1.csv", "shot11.csv"]
    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, names[0], b"t;F\n0;1\n", read=False)
        csrf = await csrf_of(client)
        for name in names[1:]:
            sent = {"params": {"name": name}, "content": b"t;F\n0;1\n", "headers": {"x-csrf-token": csrf}}
            assert (await client.put(f"/studies/{study}/files", **sent)).status_code == 201  # type: ignore[arg-type]
        await client.post(f"/studies/{study}/read", data={"csrf": csrf})
        await until(page, study, Stage.CONFIRMING, Stage.FAILED)
    given = [Path(argument).name for argument in verbs.asked[0] if argument.endswith(".csv")]
    assert given == ["shot1.csv", "shot2.csv", "shot10.csv", "shot11.csv", "shot12.csv"]


async def test_ten_at_once_are_done_one_after_the_other(page: Page, verbs: Verbs) -> None:
    verbs.held = asyncio.Event()
    async with page.logged_in(Role.OPERATOR) as client:
        ids = [(await drop(client, "shots.csv", b"1\n"))[0] for _ in range(10)]
        await asyncio.sleep(0)
        places = [page.studies.place(page.studies.store.find(study)) for study in ids]  # type: ignore[arg-type]
        assert places == list(range(10))
        assert "in the queue, place 9" in (await client.get(f"/studies/{ids[-1]}")).text
        for _ in range(MAX_WAITING - 9):
            await drop(client, "shots.csv", b"1\n")
        refused = await client.post("/studies", data={"csrf": await csrf_of(client)})
        assert refused.status_code == 503
        verbs.held.set()
        for study in ids:
            await until(page, study, Stage.CONFIRMING, Stage.FAILED)
    assert verbs.most_at_once == 1


async def test_what_is_removed_ends_and_the_next_one_begins(page: Page, verbs: Verbs) -> None:
    verbs.held = asyncio.Event()
    async with page.logged_in(Role.OPERATOR) as client, page.logged_in(Role.OBSERVER) as other:
        (first, _), (second, _) = [await drop(client, "shots.csv", b"1\n") for _ in range(2)]
        await asyncio.sleep(0)
        data = {"csrf": await csrf_of(other)}
        assert (await other.post(f"/studies/{first}/remove", data=data)).status_code == 403
        data = {"csrf": await csrf_of(client)}
        assert (await client.post(f"/studies/{first}/remove", data=data)).status_code == 303
        assert (await client.get(f"/studies/{first}")).status_code == 404
        verbs.held.set()
        await until(page, second, Stage.CONFIRMING, Stage.FAILED)
    assert not (page.users.parent / "studies" / first).exists()


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("../../etc/passwd.csv", "passwd.csv"),
        ("C:\\data\\März 3.CSV", "März_3.csv"),
        ("Messung Gleitfläche_Öl (groß).csv", "Messung_Gleitfläche_Öl_groß_.csv"),
        ("Ma\u0308rz.csv", "März.csv"),
        ("измерение №3.csv", "измерение_No3.csv"),
        ("a\u202eb\u200b.csv", "a_b_.csv"),
        ("\uff0e\uff0e\uff0fetc.csv", "etc.csv"),
        ("\U00020000" * 80 + ".csv", "\U00020000" * 50 + ".csv"),
        ("\ud800.csv", "data.csv"),
        ("<script>alert(1)</script>.csv", "script_.csv"),
        (".csv", "data.csv"),
        ("-rf.csv", "rf.csv"),
        ("a" * 300 + ".csv", "a" * 76 + ".csv"),
        ("a\x00b\n.tdms", "a_b_.tdms"),
    ],
)
def test_names_are_made_harmless(name: str, kept: str) -> None:
    assert safe_name(name) == kept


@pytest.mark.parametrize("name", ["", "data", "run.exe", "run.csv.sh", "run.yaml", "campaign/"])
async def test_other_kinds_are_refused(page: Page, name: str) -> None:
    async with page.logged_in(Role.OPERATOR) as client:
        _, answer = await drop(client, name, b"x")
    assert answer.status_code == 415
    assert answer.json() == {"error": "Files of this kind cannot be read."}


async def test_who_may_not_sends_nothing(page: Page) -> None:
    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "a.csv", b"1", read=False)
        address = f"/studies/{study}/files?name=b.csv"
        csrf = await csrf_of(client)
        for headers in ({}, {"x-csrf-token": "guess"}, {"x-csrf-token": csrf, "origin": "http://elsewhere"}):
            assert (await client.put(address, content=b"x", headers=headers)).status_code == 403
    async with page.logged_in(Role.OBSERVER) as client:
        headers = {"x-csrf-token": await csrf_of(client)}
        assert (await client.put(address, content=b"x", headers=headers)).status_code == 403
    async with page.client() as client:
        assert (await client.put(address, content=b"x")).status_code == 401
    found = page.studies.store.find(study)
    assert found is not None
    assert list(found.files) == ["a.csv"]


async def test_too_large_too_much_and_twice(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(upload, "MAX_BYTES", 100)

    async def endless() -> AsyncIterator[bytes]:
        for _ in range(1000):
            yield b"x" * 30

    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "a.csv", b"x" * 60, read=False)
        headers = {"x-csrf-token": await csrf_of(client)}
        send: dict[str, Any] = {"url": f"/studies/{study}/files", "headers": headers}
        assert (await client.put(**send, params={"name": "a.csv"}, content=b"1")).status_code == 409
        assert (await client.put(**send, params={"name": "b.csv"}, content=b"x" * 60)).status_code == 413
        assert (await client.put(**send, params={"name": "b.csv"}, content=endless())).status_code == 413
        assert (await client.put(**send, params={"name": "b.csv"}, content=b"")).status_code == 400
        monkeypatch.setattr(upload, "ROOM_LEFT_BYTES", 10**18)
        assert (await client.put(**send, params={"name": "b.csv"}, content=b"x")).status_code == 507
        monkeypatch.setattr(pages, "MAX_FILES", 1)
        assert (await client.put(**send, params={"name": "b.csv"}, content=b"x")).status_code == 409
    kept = page.users.parent / "studies" / study / "files"
    assert [path.name for path in kept.iterdir()] == ["a.csv"]


async def test_files_that_come_at_once_have_the_room_of_one_study(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(upload, "MAX_BYTES", 100)
    half, whole = asyncio.Event(), asyncio.Event()

    async def slow() -> AsyncIterator[bytes]:
        yield b"x" * 30
        half.set()
        await whole.wait()
        yield b"x" * 30

    async def unannounced() -> AsyncIterator[bytes]:
        yield b"x" * 60

    async with page.logged_in(Role.OPERATOR) as client:
        csrf = await csrf_of(client)
        headers = {"x-csrf-token": csrf}

        async def put(study: str, name: str, content: Any, **more: str) -> int:
            address = f"/studies/{study}/files?name={name}"
            return (await client.put(address, content=content, headers=headers | more)).status_code

        begin = {"csrf": csrf, "cell": CELL, "title": "rail"}
        one, other = [(await client.post("/studies", data=begin)).json()["id"] for _ in range(2)]
        first = asyncio.create_task(put(one, "a.csv", slow(), **{"content-length": "60"}))
        await half.wait()
        assert await put(one, "b.csv", b"x" * 60) == 413
        assert await put(one, "b.csv", unannounced()) == 413
        assert await put(other, "b.csv", b"x" * 60) == 201, "another study has room of its own"
        assert await put(one, "b.csv", b"x" * 40) == 201
        whole.set()
        assert await first == 201
        assert await put(one, "c.csv", b"x") == 413
    assert [page.studies.store.find(study).files for study in (one, other)] == [  # type: ignore[union-attr]
        {"a.csv": 60, "b.csv": 40},
        {"b.csv": 60},
    ]


async def test_two_gigabytes_are_refused_before_any_of_them_is_read(page: Page) -> None:
    asked: list[int] = []

    async def body() -> AsyncIterator[bytes]:
        for number in range(2000):
            asked.append(number)
            yield b"x" * 1_000_000

    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "a.csv", b"x", read=False)
        headers = {"x-csrf-token": await csrf_of(client), "content-length": "2000000000"}
        send: dict[str, Any] = {"url": f"/studies/{study}/files", "params": {"name": "b.csv"}}
        answer = await client.put(**send, headers=headers, content=body())
        assert answer.status_code == 413
        assert "500 MB" in answer.json()["error"]
    assert asked == []
    kept = page.users.parent / "studies" / study / "files"
    assert [path.name for path in kept.iterdir()] == ["a.csv"]


async def test_an_upload_that_stalls_or_breaks_off_leaves_nothing(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(upload, "STALLED_S", 0.02)
    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "a.csv", b"x", read=False)
        cookie = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
        csrf = await csrf_of(client)
    for last, status in ((None, 408), ({"type": "http.disconnect"}, 400)):
        sent: list[Any] = []
        messages = [{"type": "http.request", "body": b"half", "more_body": True}, last]

        async def receive(messages: list[Any] = messages) -> Any:
            message = messages.pop(0)
            return message if message is not None else await asyncio.Event().wait()

        async def send(message: Any, sent: list[Any] = sent) -> None:
            sent.append(message)

        headers = {"host": "127.0.0.1:8480", "cookie": cookie, "x-csrf-token": csrf}
        scope = {
            "type": "http", "method": "PUT", "path": f"/studies/{study}/files", "query_string": b"name=b.csv",
            "headers": [(k.encode(), v.encode()) for k, v in headers.items()], "http_version": "1.1",
            "scheme": "http", "server": ("127.0.0.1", 8480), "client": ("127.0.0.1", 1), "root_path": "",
        }  # fmt: skip
        await page.app(scope, receive, send)  # type: ignore[operator]
        assert sent[0]["status"] == status
    found = page.studies.store.find(study)
    assert found is not None
    assert list(found.files) == ["a.csv"]
    assert [path.name for path in page.studies.store.files(found).iterdir()] == ["a.csv"]


async def test_rows_that_are_wider_than_the_header_are_told_as_they_are_elsewhere(
    page: Page, tmp_path: Path
) -> None:
    """A mass with a decimal comma is two cells."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as packed:
        packed.writestr("campaign.yaml", "format: 1\nexcitation: tap\n")
        packed.writestr("shots.csv", "shot,velocity_mm_per_min,mass_kg\n1,4000,18,9\n\n2,5000,3\n3,5000\n")
        for shot in (1, 2, 3):
            packed.writestr(f"traces/{shot}.csv", "time_s,force_n\n0,0\n")
    async with page.logged_in(Role.OPERATOR) as client:
        study, _ = await drop(client, "shots.zip", content.getvalue())
        found = await until(page, study, Stage.FAILED)
        shown = {code: (await client.get(f"/studies/{study}?lang={code}")).text for code in ("en", "de")}
    assert found.faults == [
        "shots.csv:2: 4 cells where the header has 3",
        "shots.csv:5: 2 cells where the header has 3",
    ]
    assert '<li lang="en">shots.csv:2: 4 cells where the header has 3</li>' in shown["en"]
    assert '<li lang="de">shots.csv:2: 4 Zellen, die Kopfzeile hat 3</li>' in shown["de"]
    with zipfile.ZipFile(content) as packed:
        packed.extractall(tmp_path / "campaign")
    with pytest.raises(CampaignError) as told:
        read(tmp_path / "campaign")
    assert str(told.value).replace(f"{tmp_path}/campaign/", "").splitlines()[:2] == found.faults


def bomb() -> bytes:
    return campaign_zip(traces__3=b"", **{"traces__4.csv": b"0" * 50_000_000})


def lying() -> bytes:
    """An archive whose directory says less than what comes of it."""
    data = bytearray(campaign_zip(**{"traces__3.csv": b"7" * 1000}))
    at = data.rindex(b"traces/3.csv") - 46
    data[at + 24 : at + 28] = (10).to_bytes(4, "little")
    return bytes(data)


def many() -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as packed:
        for number in range(campaign_archive.MAX_MEMBERS + 1):
            packed.writestr(f"traces/{number}.csv", b"")
        packed.writestr("campaign.yaml", b"")
    return content.getvalue()


@pytest.mark.parametrize(
    "make_archive",
    [
        bomb,
        lying,
        many,
        lambda: b"no zip at all",
        lambda: campaign_zip()[:200],
        lambda: b"PK\x03\x04" + b"\0" * 500,
    ],
    ids=["bomb", "lying", "many", "text", "cut off", "zeros"],
)
async def test_archives_that_are_refused(page: Page, make_archive: Callable[[], bytes]) -> None:
    async with page.logged_in(Role.OPERATOR) as client:
        study, answer = await drop(client, "shots.zip", make_archive())
        assert answer.status_code == 201
        found = await until(page, study, Stage.FAILED)
    assert found.faults
    assert "fault of this program" not in found.faults[0]
    assert sum(path.stat().st_size for path in (page.users.parent / "studies").rglob("*.csv")) < 20_000_000


def test_nothing_is_unpacked_elsewhere(tmp_path: Path) -> None:
    target = tmp_path / "a" / "campaign"
    path = tmp_path / "shots.zip"
    extra = {"..__..__evil.csv": b"x", "__etc__passwd": b"x", "traces__.._.csv": b"x", "readme.txt": b"x"}
    path.write_bytes(campaign_zip(**extra))
    unpack_campaign(path, target)
    written = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file())
    assert written == [
        *("a/campaign/campaign.yaml", "a/campaign/shots.csv"),
        *("a/campaign/traces/1.csv", "a/campaign/traces/2.csv", "shots.zip"),
    ]
    twice = tmp_path / "twice.zip"
    shutil.copy(path, twice)
    with zipfile.ZipFile(twice, "a") as packed, pytest.warns(UserWarning, match="Duplicate"):
        packed.writestr("shots.csv", b"another")
    with pytest.raises(CampaignError, match="twice"):
        unpack_campaign(twice, tmp_path / "b")


async def test_many_files_are_folded(page: Page) -> None:
    async with page.logged_in(Role.OBSERVER) as client:
        study = page.studies.store.begin("rail", "otto", CELL)
        study.files = {f"tap-{number}.csv": 115_000 for number in range(27)}
        many = (await client.get(f"/studies/{study.id}?lang=de")).text
        study.files = {"tap-0.csv": 115_000}
        one = (await client.get(f"/studies/{study.id}?lang=de")).text
    assert '<details class="help"><summary>27 Dateien, 3,1 MB</summary>tap-0.csv, tap-1.csv, ' in many
    assert "tap-0.csv (120 kB)" in one
    assert "Dateien, " not in one


async def test_parameters_are_said_in_words_with_their_unit(page: Page) -> None:
    found = {
        "effect": "stribeck_friction",
        "parameters": {
            "stribeck_velocity_m_s": {"value": 0.04, "ci95": [0.035, 0.046]},
            "friction_increase": {"value": 0.03},
        },
    }
    strength = {"value": [60.0, 70.0], "ci95": [[57.0, 63.0], [66.0, None]]}
    own = {"effect": "own_effect", "parameters": {"strength_n_per_m": strength}}
    changes = [
        {"parameter": name, "before": None, "after": 1.5}
        for name in ("mu_s", "stiffness_n_per_m", "viscous_friction.viscous_coefficient_n_s_per_m")
    ]
    changes[2] |= {"ci95": [1.25, 1.75]}
    async with page.logged_in(Role.OBSERVER) as client:
        study = page.studies.store.begin("rail", "otto", CELL)
        study.stage, study.result = Stage.DONE, RESULT | {"effects": [found, own]}
        study.changes = CHANGES | {"changes": changes, "after": "rail + stribeck_friction + own_effect"}
        study.acceptances = [Acceptance("accept", "eva", 1, "rail + stribeck_friction")]
        shown = {code: (await client.get(f"/studies/{study.id}?lang={code}")).text for code in ("en", "de")}
    assert "</b> · Stribeck velocity 0.04 m/s (95 %: 0.035 to 0.046) · friction increase 0.03" in shown["en"]
    assert (
        "</b> · Stribeck-Geschwindigkeit 0,04 m/s (95 %: 0,035 bis 0,046) · Zunahme der Reibung 0,03"
        in shown["de"]
    )
    assert "Own effect</b> · strength n per m 60, 70 (95 %: 57 to 63, 66 to –)" in shown["en"]
    names = re.findall(r'<tr><td data-label="[^"]*">(.*?)</td>', shown["de"])
    assert "old → <b>rail + Stribeck friction + own_effect</b>" in shown["en"]
    assert "old → <b>rail + Stribeck-Reibung + own_effect</b>" in shown["de"]
    assert "rail + Stribeck-Reibung, eva" in shown["de"]
    assert '<td data-label="Nachher">1,5 (95 %: 1,25 bis 1,75)</td>' in shown["de"]
    assert '<td data-label="After">1.5</td>' in shown["en"]
    assert names == ["µs", "Steifigkeit [N/m]", "Viskose Reibung: viskoser Koeffizient [N s/m]"]


@pytest.mark.parametrize(
    ("after", "ci95", "explained", "differs"),
    [
        (2921.65, [2694.53, 3148.74], False, True),
        (2921.65, [2694.53, 3148.74], True, False),
        (2600.0, [2400.0, 2800.0], False, False),
        (2921.65, None, False, True),
        (2500.5, None, False, False),
        (2921.65, [None, 3148.74], False, False),
    ],
)
async def test_of_two_values_of_a_parameter_one_is_said_to_be_believed(
    page: Page, after: float, ci95: list[float | None] | None, explained: bool, differs: bool
) -> None:
    """A drag was 2500, the contact another, too: 2499.9 came out, and 2921.7 stood beside *Accept*."""
    drag = {"drag_coefficient_n_s2_per_m2": {"value": 2499.94, "ci95": [2498.85, 2501.4]}}
    factors = {"factor_change": {"value": [0.1, 0.2], "ci95": [[0.0, 0.2], [0.1, 0.3]]}}
    changes = [
        {"parameter": "mu_k", "before": 0.2, "after": 0.21, "ci95": None},
        {"parameter": "quadratic_drag.drag_coefficient_n_s2_per_m2", "before": None, "after": after},
        {"parameter": "batch_effect.factor_change", "before": None, "after": [0.1, 0.2]},
    ]
    changes[1]["ci95"] = ci95
    async with page.logged_in(Role.OBSERVER) as client:
        study = page.studies.store.begin("own-drag.zip", "otto", CELL)
        effects = [
            {"effect": "quadratic_drag", "parameters": drag},
            {"effect": "batch_effect", "parameters": factors},
        ]
        remaining = {"explained": explained, "model_error": {"level": 7.1899}}
        study.stage, study.result = Stage.DONE, RESULT | {"effects": effects, "remaining": remaining}
        study.changes = CHANGES | {"changes": changes, "after": "rail + quadratic_drag"}
        shown = {code: (await client.get(f"/studies/{study.id}?lang={code}")).text for code in ("en", "de")}
    said = {
        "en": "Quadratic drag: drag coefficient [N s²/m²]: “Outcome” has another value, which is to be",
        "de": "[N s²/m²]: Im „Ergebnis“ steht ein anderer Wert, und der gilt",
    }
    for language, level in (("en", "model error of 7.2 noise"), ("de", "Modellfehler von 7,2 Rausch")):
        assert (said[language] in shown[language]) is differs
        assert (level in shown[language]) is differs


async def test_a_report_can_do_nothing(page: Page) -> None:
    async with page.logged_in(Role.OBSERVER) as client:
        store = page.studies.store
        study = store.begin("<script>owned()</script>", "otto", CELL)
        store.results(study).mkdir()
        (store.results(study) / "report.html").write_text("<script>owned()</script>")
        study.stage, study.result = Stage.DONE, RESULT | {"headline": "<script>owned()</script>"}
        answer = await client.get(f"/studies/{study.id}/report")
        shown = await client.get(f"/studies/{study.id}")
        listed = await client.get("/studies")
        for name in ("study.json", "..%2fstudy.json", "model.extended.yaml"):
            assert (await client.get(f"/studies/{study.id}/files/{name}")).status_code == 404
    assert answer.headers["content-security-policy"] == REPORT_POLICY
    assert "script-src" not in REPORT_POLICY
    assert REPORT_POLICY.endswith("sandbox")
    for page_shown in (shown, listed):
        assert "<script>owned" not in page_shown.text
        assert "script-src 'self'" in page_shown.headers["content-security-policy"]


async def test_a_report_is_shown_in_the_language_of_who_reads_it(page: Page) -> None:
    async with page.logged_in(Role.OBSERVER) as client:
        store = page.studies.store
        study = store.begin("rail", "otto", CELL)
        store.results(study).mkdir()
        study.stage, study.result = Stage.DONE, dict(RESULT)
        (store.results(study) / "report.html").write_text("English")
        address = f"/studies/{study.id}"
        only_english = (await client.get(f"{address}/report?lang=de")).text
        (store.results(study) / "report.de.html").write_text("Deutsch")
        shown = {code: (await client.get(f"{address}/report?lang={code}")).text for code in ("en", "de")}
        linked = (await client.get(f"{address}?lang=de")).text
        taken = await client.get(f"{address}/files/report.de.html")
    assert only_english == "English"
    assert shown == {"en": "English", "de": "Deutsch"}
    assert f"{address}/files/report.de.html" in linked
    assert taken.text == "Deutsch"


async def test_a_restart_keeps_what_is_done_and_says_what_was_not(tmp_path: Path) -> None:
    store = StudyStore(tmp_path)
    done, open_ = store.begin("done", "otto", CELL), store.begin("open", "otto", CELL)
    done.stage, done.result, open_.stage = Stage.DONE, RESULT, Stage.STUDYING
    for study in (done, open_):
        store.save(study)
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "study.json").write_text("{")
    again = {study.title: study for study in StudyStore(tmp_path)}
    assert sorted(again) == ["done", "open"]
    assert again["done"].result == RESULT
    assert again["open"].stage is Stage.FAILED
    assert again["open"].faults == ["the service was restarted meanwhile"]


def test_a_restart_forgets_what_came_out_of_another_reading(tmp_path: Path) -> None:
    """Earlier versions kept it when files were read again; what was being accepted came out of the last."""
    store = StudyStore(tmp_path)
    for stage, accepting in ((Stage.CONFIRMING, ""), (Stage.READING, ""), (Stage.DONE, "accept")):
        study = store.begin(stage.value, "otto", CELL)
        study.stage, study.accepting, study.result, study.changes = stage, accepting, RESULT, CHANGES
        store.save(study)
    again = {study.title: study for study in StudyStore(tmp_path)}
    assert {title: (study.stage, bool(study.result)) for title, study in again.items()} == {
        "confirming": (Stage.CONFIRMING, False),
        "reading": (Stage.FAILED, False),
        "done": (Stage.DONE, True),
    }
    assert again["done"].can_be_accepted
    assert again["done"].refusals == ["the service was restarted meanwhile"]


def test_the_oldest_make_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("impactcell.web.studies.study.KEPT_STUDIES", 3)
    store = StudyStore(tmp_path)
    for number in range(6):
        study = store.begin(str(number), "otto", CELL)
        study.created_ms, study.stage = number, Stage.DONE
    assert [study.title for study in store] == ["5", "4", "3"]
    assert len(list(tmp_path.iterdir())) == 3
