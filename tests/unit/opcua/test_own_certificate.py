"""A certificate of the server's own that has ended, or is none, is told before its clients tell it."""

import datetime as dt
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.serialization import Encoding

from impactcell.cli import access
from impactcell.errors import AccessError
from impactcell.opcua.certificates.own_certificate import made_anew
from impactcell.opcua.certificates.trust_list import TrustList
from impactcell.scada import default_application_uri
from impactcell.settings import read_cell
from impactcell.settings.judgement import CellFinding, judge_cell
from tests.certificates import self_signed
from tests.unit.settings.test_impossible_paths import cell_file

URI = default_application_uri()
NOW = dt.datetime.now(dt.UTC)
DAY = dt.timedelta(days=1)


def pki(directory: Path, begin: float = -10.0, end: float = 300.0, uri: str = URI) -> Path:
    self_signed(directory / "pki" / "own", uri, NOW + begin * DAY, NOW + end * DAY, Encoding.DER)
    return directory / "pki"


def judged(cell: Path, key: str) -> list[CellFinding]:
    return [one for one in judge_cell(read_cell(cell)) if one.section == key]


def test_the_log_tells_it_at_first_and_once_a_day(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    here = pki(tmp_path, -100.0, -2.0)
    trust = TrustList(here, URI)
    for now in (NOW, NOW, NOW + DAY):
        trust.look_at_own(now)
    own = here / "own"
    told = f"{own}/cert.der: ended on {NOW - 2 * DAY:%Y-%m-%d}: move cert.der and key.pem out of {own}"
    assert [line.startswith(told) for line in caplog.messages] == [True, True]
    assert f"`impactcell certs make {here}`; clients have to trust the new one" in caplog.messages[0]


@pytest.mark.parametrize(
    ("begin", "end", "told", "mark"),
    [
        (-100.0, -2.0, "ended on {end:%Y-%m-%d}: ", "(ended)"),
        (
            5.0,
            300.0,
            "is not valid before {begin:%Y-%m-%d}; if it is not ",
            "(not yet valid)",
        ),
        (-10.0, 29.0, "ends on {end:%Y-%m-%d}: ", ""),
        (-10.0, 31.0, "", ""),
    ],
)
def test_check_and_certs_list_tell_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], begin: float, end: float, told: str, mark: str
) -> None:
    here = pki(tmp_path, begin, end)
    notes = judged(cell_file(tmp_path, "opcua.certificates_dir", "pki"), "opcua")
    said = [str(one) for one in notes if "cert.der" in one.message]
    assert len(said) == bool(told)
    for line in said:
        when = told.format(begin=NOW + begin * DAY, end=NOW + end * DAY)
        assert f":6:27: note: {here}/own/cert.der: {when}" in line
        assert made_anew(here) in line
    access.list_certs(here)
    (line,) = capsys.readouterr().out.splitlines()
    assert line.endswith(f"CN=own {mark}".rstrip())


def _garbage(here: Path) -> None:
    (here / "own" / "cert.der").write_text("hello")


def _other_key(here: Path) -> None:
    _, key = self_signed(here / "other", URI, NOW, NOW + DAY, Encoding.DER)
    shutil.move(key, here / "own" / "key.pem")


def _other_host(here: Path) -> None:
    shutil.rmtree(here / "own")
    pki(here.parent, uri="urn:elsewhere:impactcell")


def _no_key(here: Path) -> None:
    (here / "own" / "key.pem").unlink()


@pytest.mark.parametrize(
    ("spoil", "told", "way_out"),
    [
        (_garbage, "cert.der: no certificate in PEM or DER; put it back, or move cert.der and key.pem", True),
        (_other_key, "key.pem: not the RSA key of {}/own/cert.der; put that back, or move cert.der", True),
        (_other_host, "cert.der: made for another application URI than urn:", True),
        (_no_key, "key.pem: No such file or directory; put it back, or move cert.der away too", False),
    ],
)
def test_check_refuses_what_run_refuses(
    tmp_path: Path, spoil: Callable[[Path], None], told: str, *, way_out: bool
) -> None:
    here = pki(tmp_path)
    spoil(here)
    with pytest.raises(AccessError) as refused:
        TrustList(here, URI)
    assert f"{here}/own/{told.format(here)}" in str(refused.value)
    assert (made_anew(here) in str(refused.value)) is way_out
    cell = cell_file(tmp_path, "opcua.certificates_dir", "pki")
    (fault,) = [one for one in judged(cell, "opcua") if one.is_fault]
    assert fault.message == f"opcua.certificates_dir: {refused.value}"


@pytest.mark.parametrize("barred", ["cert.der", "key.pem"])
def test_what_is_not_to_be_read_is_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, barred: str
) -> None:
    here, look = pki(tmp_path), os.access
    monkeypatch.setattr(os, "access", lambda file, mode: Path(file).name != barred and look(file, mode))
    (note,) = [
        one
        for one in judged(cell_file(tmp_path, "opcua.certificates_dir", "pki"), "opcua")
        if barred in one.message
    ]
    assert note.message == f"{here}/own/{barred} is not yours to read: not looked at"
    assert not note.is_fault


def test_a_first_start_makes_them(tmp_path: Path) -> None:
    cell = cell_file(tmp_path, "opcua.certificates_dir", "pki")
    assert not [one for one in judged(cell, "opcua") if "users" not in one.message]
