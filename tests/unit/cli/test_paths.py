"""What a verb is given is looked at before it works, and found wanting as bad input."""

from pathlib import Path

import pytest

from impactcell.__main__ import main

CELL = str(Path(__file__).resolve().parents[3] / "config" / "cells" / "prototype.yaml")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("export", "{dir}/j", "-o", "{dir}/out"), "{dir}/j: there is no such journal"),
        (
            ("discrepancy", "--journal", "{dir}/j", "-o", "{dir}/out"),
            "{dir}/j: there is no such journal",
        ),
        (("discrepancy", "{dir}/none", "-o", "{dir}/file"), "{dir}/file: is a file; name a directory"),
        (
            ("estimate", "{dir}/none", "-o", "{dir}/no/x.csv"),
            "{dir}/no/x.csv: cannot be written",
        ),
        (("calibrate", CELL, "-o", "{dir}/no/m.yaml"), "{dir}/no/m.yaml: cannot be written"),
    ],
)
def test_bad_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], message: str
) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(SystemExit) as end:
        main([argument.format(dir=tmp_path) for argument in arguments])
    out, err = capsys.readouterr()
    assert (end.value.code, out) == (2, "")
    assert err.startswith(message.format(dir=tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
