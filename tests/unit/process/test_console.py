"""`-q` silences what is said beside a result, and never the result."""

import logging
from pathlib import Path

import pytest

from impactcell.cli import discrepancy as command
from impactcell.cli.app import app
from impactcell.journal.store import Journal
from impactcell.process.console import print_note
from tests.snapshots import make_capture, make_snapshot

PKG = logging.getLogger("impactcell")


@pytest.fixture(autouse=True)
def level() -> None:
    """Start as `main` does."""
    PKG.setLevel(logging.INFO)


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    app(list(arguments), standalone_mode=False)
    return capsys.readouterr().out


@pytest.mark.parametrize(("options", "said"), [((), "1 shots in "), (("-v",), "1 shots in "), (("-q",), "")])
def test_export(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], said: str
) -> None:
    with Journal(tmp_path / "j", "press-1") as journal:
        capture = make_capture(1)
        journal.append(capture, make_snapshot(capture), b"state")
    out = run(capsys, "export", str(tmp_path / "j"), "-o", str(tmp_path / "c"), *options)
    assert out[: len(said)] == said
    assert bool(out) == bool(said)
    assert (tmp_path / "c" / "shots.csv").exists()


@pytest.mark.parametrize(
    ("options", "said", "noted"),
    [
        ((), "Missing: x\nout/report.html\n", "note: one mass only\n"),
        (("-q",), "", ""),
        (("--json",), '{"notes": ["one mass only"]}', ""),
    ],
)
def test_discrepancy(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    options: tuple[str, ...],
    said: str,
    noted: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, made in (("_read", ("name", None)), ("investigate", None)):
        monkeypatch.setattr(command, name, lambda *_, made=made, **__: made)

    def write_findings(_result: object, _data: object, output: Path, *_: object) -> None:
        output.mkdir()
        (output / "result.json").write_text('{"notes": ["one mass only"]}', encoding="utf-8")

    monkeypatch.setattr(command, "write_findings", write_findings)
    monkeypatch.setattr(command, "headline", lambda _: "Missing: x")
    app(["discrepancy", "shots", "-o", "out", *options], standalone_mode=False)
    assert capsys.readouterr() == (said, noted)


@pytest.mark.parametrize(("level", "said"), [(logging.INFO, "2 left out\n"), (logging.ERROR, "")])
def test_a_note_is_no_error(capsys: pytest.CaptureFixture[str], level: int, said: str) -> None:
    PKG.setLevel(level)
    print_note("2 left out")
    assert capsys.readouterr() == ("", said)


def test_a_result_is_written_whatever_the_options(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "schema", "-q").startswith("{")
