"""What a verb is given is looked at before it works, and found wanting as bad input."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from impactcell.__main__ import main
from impactcell.campaign import Campaign, Excitation, write
from impactcell.errors import CampaignError
from impactcell.records import Capture, Channel

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


@pytest.fixture
def theirs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory of somebody else's; root, who may look everywhere, is refused as others are."""
    place, look = tmp_path / "theirs", Path.stat

    def stat(path: Path, *, follow_symlinks: bool = True) -> os.stat_result:
        if place in path.parents:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return look(path, follow_symlinks=follow_symlinks)

    monkeypatch.setattr(Path, "stat", stat)
    place.mkdir()
    return place


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("estimate", "{dir}/c"), "{dir}/c: cannot be read: Permission denied"),
        (("estimate", "none", "-o", "{dir}/out.csv"), "{dir}/out.csv: cannot be written: Permission denied"),
        (("discrepancy", "{dir}/c", "-o", "out"), "{dir}/c: cannot be read: Permission denied"),
        (("discrepancy", "none", "-o", "{dir}/r"), "{dir}/r: cannot be written: Permission denied"),
        (("discrepancy", "none", "-o", "{dir}/a/r"), "{dir}/a/r: cannot be written: Permission denied"),
        (("discrepancy", "--journal", "{dir}/j", "-o", "r"), "{dir}/j: cannot be read: Permission denied"),
        (("export", "{dir}/j", "-o", "out"), "{dir}/j: cannot be read: Permission denied"),
        (("calibrate", CELL, "-o", "{dir}/m.yaml"), "{dir}/m.yaml: cannot be written: Permission denied"),
        (("init", "{dir}/cell", *CELL_ANSWERS), "{dir}/cell: cannot be written: Permission denied"),
        (("init", "cell", *CELL_ANSWERS, "--map", "{dir}/m"), "{dir}/m: cannot be read: Permission denied"),
        (("users", "add", "{dir}/u.yaml", "eva"), "{dir}/u.yaml: cannot be written: Permission denied"),
        (("users", "list", "{dir}/u.yaml"), "{dir}/u.yaml: cannot be read: Permission denied"),
        (("certs", "list", "{dir}/pki"), "{dir}/pki: cannot be read: Permission denied"),
        (("certs", "make", "{dir}/pki"), "{dir}/pki: cannot be written: Permission denied"),
    ],
)
def test_what_nobody_may_look_at_is_bad_input(
    theirs: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    told: str,
) -> None:
    monkeypatch.chdir(theirs.parent)
    with pytest.raises(SystemExit) as end:
        main([argument.format(dir=theirs) for argument in arguments])
    out, err = capsys.readouterr()
    assert (end.value.code, out) == (2, "")
    assert err.startswith(told.format(dir=theirs))
    assert err.count("\n") == 1
    assert list(theirs.parent.iterdir()) == [theirs]


def test_a_campaign_is_not_written_where_nobody_may_look(theirs: Path) -> None:
    shot = Capture(1, 0.05, 18.9, force=Channel(np.arange(3.0), np.ones(3), 0.4), position=None)
    taps = Campaign(Excitation.TAP, (shot,), columns=("shot", "velocity_mm_per_min"))
    with pytest.raises(CampaignError, match="theirs/c: cannot be written: Permission denied"):
        write(taps, theirs / "c")


def test_a_directory_that_is_there_and_somebody_elses_is_told_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    monkeypatch.setattr("os.access", lambda path, mode: path != out or not mode & os.W_OK)
    with pytest.raises(SystemExit) as end:
        main(["discrepancy", str(tmp_path / "none"), "-o", str(out)])
    assert end.value.code == 2
    assert f"out: cannot be written: you may not write in {out}; name" in capsys.readouterr().err
