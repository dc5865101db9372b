"""What a report is called: by what was given, whatever the directory is called that it was unpacked into."""

from pathlib import Path

import pytest

from impactcell.cli import discrepancy as command
from impactcell.cli.app import app


@pytest.mark.parametrize("writes", ["write_findings", "write_machine_findings"])
@pytest.mark.parametrize(
    ("options", "called"),
    [((), "campaign"), (("--title=",), "campaign"), (("--title=--own drag.zip",), "--own drag.zip")],
)
def test_a_report_has_the_title_that_is_given(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, writes: str, options: tuple[str, ...], called: str
) -> None:
    seen: list[str] = []
    for name in ("read", "with_cell_mass", "investigate", "investigate_with_base", "_print_outcome"):
        monkeypatch.setattr(command, name, lambda *_, **__: None)
    for name in ("headline", "machine_headline"):
        monkeypatch.setattr(command, name, lambda _: "Missing: x")
    monkeypatch.setattr(command, writes, lambda _result, _data, _output, source, *_: seen.append(source))
    base = ("--base", "base.yaml") if writes == "write_machine_findings" else ()
    given = ["discrepancy", str(tmp_path / "campaign"), "-o", str(tmp_path / "out"), *options, *base]
    app(given, standalone_mode=False)
    assert seen == [called]
