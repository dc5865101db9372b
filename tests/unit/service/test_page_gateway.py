"""A model that is changed on the page: nothing happens to a cell that cannot write it down."""

import json
import logging
from collections.abc import Sequence
from pathlib import Path

import pytest

from impactcell.process.background import VerbOutcome
from impactcell.scada import Actor, RefusedError, Role
from impactcell.service import page_gateway
from impactcell.service.operator_commands import OperatorCommands
from impactcell.service.page_gateway import PageGateway
from impactcell.settings import read_cell
from impactcell.web.messages import Messages
from tests.integration.processes import CONFIG

EVA = Actor("eva", Role.ENGINEER, "10.0.0.7")
CELL = read_cell(CONFIG / "cells" / "prototype.yaml")


class Worker:
    """Writes down nothing."""

    async def record(self, _: object) -> None:
        raise RuntimeError("cannot schedule new futures after shutdown")


class Task:
    worker = Worker()


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Verbs that were run, without their files."""
    ran: list[str] = []

    async def run_verb(arguments: Sequence[str], _timeout_s: float) -> VerbOutcome:
        ran.append(" ".join(arguments[:2]))
        return VerbOutcome(0, json.dumps({"model": "extended"}), ())

    monkeypatch.setattr(page_gateway, "run_verb", run_verb)
    return ran


async def change(gateway: PageGateway, action: str) -> str:
    if action == "accept":
        return await gateway.accept_model(CELL.name, Path("model.extended.yaml"), EVA)
    return await gateway.restore_model(CELL.name, EVA)


@pytest.mark.parametrize("action", ["accept", "restore"])
async def test_the_model_of_a_cell_that_does_not_run_stays(ran: list[str], action: str) -> None:
    gateway = PageGateway({}, OperatorCommands({}), [CELL], Path())
    with pytest.raises(RefusedError, match="does not run, its journal cannot be opened") as refused:
        await change(gateway, action)
    assert ran == []
    language, told = Messages("de").fault(str(refused.value))
    assert language == "de"
    assert told == (
        f"{CELL.name}: läuft nicht, ihr Journal lässt sich nicht öffnen; "
        "ihr Alarm „Journal gestört“ sagt, warum"
    )


@pytest.mark.parametrize("action", ["accept", "restore"])
async def test_a_model_that_is_in_service_is_told_though_it_is_not_written_down(
    ran: list[str], action: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR):
        gateway = PageGateway({}, OperatorCommands({CELL.name: Task()}), [CELL], Path())  # type: ignore[dict-item]
        assert await change(gateway, action) == "extended"
    assert ran == [f"model {action}"]
    assert f"{CELL.name}: model extended is in service, but not written down" in caplog.text


async def test_a_machine_that_starts_no_program_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    async def fork(*_: object) -> VerbOutcome:
        raise OSError(12, "Cannot allocate memory")

    monkeypatch.setattr(page_gateway, "run_verb", fork)
    gateway = PageGateway({}, OperatorCommands({CELL.name: Task()}), [CELL], Path())  # type: ignore[dict-item]
    with pytest.raises(RefusedError, match="Cannot allocate memory") as refused:
        await gateway.restore_model(CELL.name, EVA)
    language, told = Messages("de").fault(str(refused.value))
    assert language == "de"
    assert told.startswith(
        f"{CELL.name}: ihr Modell bleibt, auf diesem Rechner lässt sich kein Programm starten"
    )


async def test_a_refusal_does_not_begin_with_the_name_of_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    async def refuse(*_: object) -> VerbOutcome:
        return VerbOutcome(1, "", (f"impactcell: {CELL.name}: part would not slide",))

    monkeypatch.setattr(page_gateway, "run_verb", refuse)
    gateway = PageGateway({}, OperatorCommands({CELL.name: Task()}), [CELL], Path())  # type: ignore[dict-item]
    with pytest.raises(RefusedError, match=f"^{CELL.name}: part would not slide$"):
        await change(gateway, "accept")
