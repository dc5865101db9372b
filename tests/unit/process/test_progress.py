"""What a verb says while it works: never where its result goes."""

import logging
from collections.abc import Iterator

import pytest

from impactcell.cli.app import run_verb
from impactcell.numerics.compilation import announce_compilation, on_compilation
from impactcell.process.progress import COMPILING, LINES_VARIABLE
from impactcell.web.messages import Messages


@pytest.fixture(autouse=True)
def verb_that_lacks_machine_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[None]:
    monkeypatch.delenv(LINES_VARIABLE, raising=False)
    with pytest.raises(SystemExit):
        run_verb(["--version"])
    capsys.readouterr()
    yield
    on_compilation(lambda: None)


def test_compiling_is_said_once_and_beside_the_result(capsys: pytest.CaptureFixture[str]) -> None:
    announce_compilation()
    announce_compilation()
    assert capsys.readouterr() == ("", f"{COMPILING}\n")


def test_quiet_is_quiet(capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.ERROR, "impactcell")
    announce_compilation()
    assert capsys.readouterr() == ("", "")


def test_the_page_is_told_by_a_step(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(LINES_VARIABLE, "1")
    announce_compilation()
    assert capsys.readouterr().err == f"step: {COMPILING}\n"
    assert Messages("de").step(COMPILING).startswith("Übersetzen")


def test_who_asked_last_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    told: list[str] = []
    on_compilation(lambda: told.append("service"))
    announce_compilation()
    assert told == ["service"]
    assert capsys.readouterr().err == ""
