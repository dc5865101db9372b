"""What a verb is given is looked at before it works, and found wanting as bad input."""

from pathlib import Path

import pytest

from impactcell.__main__ import main

CELL = str(Path(__file__).resolve().parents[3] / "config" / "cells" / "prototype.yaml")

CELL_ANSWERS = (
    "--name", "a", "--host", "127.0.0.1", "--port", "1", "--mass-kg", "1", "--stroke-mm", "1",
    "--max-velocity-mm-per-min", "6000", "--wear-limit", "0.3", "--force-noise-n", "1", "--map", "fpga-v1",
    "--position-noise-um", "1",
)  # fmt: skip


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
        (("calibrate", CELL, "-o", "{dir}"), "{dir}: is a directory; name a file in it"),
        (("estimate", "{dir}/none", "-o", "{dir}"), "{dir}: is a directory; name a file in it"),
        (
            ("discrepancy", "{dir}/none", "-o", "{dir}/file/out"),
            "{dir}/file/out: cannot be written: {dir}/file is a file",
        ),
        (("certs", "list", "{dir}/file"), "{dir}/file: is a file; name the directory that holds own"),
        (("certs", "make", "{dir}/file"), "{dir}/file: is a file; name a directory"),
        (
            ("users", "add", "{dir}/no/users.yaml", "eva"),
            "{dir}/no/users.yaml: cannot be written: there is no directory {dir}/no; make it first",
        ),
        (("users", "add", "{dir}", "eva"), "{dir}: is a directory; name a file in it"),
        (
            ("users", "add", "{dir}/u.yaml", "eva", "--certificate", "{dir}/file"),
            "{dir}/file: no certificate in PEM or DER; name the client's certificate (.der, .pem or .crt)",
        ),
        (
            ("certs", "trust", "{dir}/file"),
            "{dir}/file: no certificate in PEM or DER; name the client's certificate (.der, .pem or .crt)",
        ),
        (
            ("certs", "trust", "{dir}/none"),
            "{dir}/none: No such file or directory; name the client's certificate (.der, .pem or .crt)",
        ),
        (("init", "{dir}/file", *CELL_ANSWERS), "{dir}/file: is a file; name a directory"),
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


def test_a_place_that_is_somebody_elses_is_told_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr("os.access", lambda path, _: asked.append(path))  # root may write everywhere
    with pytest.raises(SystemExit) as end:
        main(["discrepancy", str(tmp_path / "none"), "-o", str(tmp_path / "a" / "out")])
    assert end.value.code == 2
    assert f"out: cannot be written: you may not write in {tmp_path}; name" in capsys.readouterr().err
    assert asked == [tmp_path]
