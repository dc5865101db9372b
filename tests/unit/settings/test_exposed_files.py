"""A users file or a private key that others than its owner can read or write is told, and refuses nothing."""

import logging
import os
from pathlib import Path

import pytest

from impactcell.cli.check import check
from impactcell.service import service
from impactcell.service.factory import cell_facts
from impactcell.settings import read_cell
from impactcell.settings.exposed_files import exposed_files
from tests.unit.settings.test_impossible_paths import cell_file

pytestmark = pytest.mark.skipif(os.name != "posix", reason="modes tell of access on POSIX only")
USERS = "users: [{name: eva, role: engineer, password: x}]"


def with_users(directory: Path, mode: int) -> Path:
    users = directory / "users.yaml"
    users.write_text(USERS, encoding="utf-8")
    users.chmod(mode)
    return cell_file(directory, "opcua.users_file", "users.yaml")


@pytest.mark.parametrize(
    ("mode", "can"),
    [
        (0o600, ""),
        (0o640, ""),
        (0o644, "read"),
        (0o620, "write"),
        (0o602, "write"),
        (0o666, "read and write"),
    ],
)
def test_a_users_file_open_to_others_is_a_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], mode: int, can: str
) -> None:
    cell = with_users(tmp_path, mode)
    check([cell])  # and refuses nothing
    users = tmp_path / "users.yaml"
    told = (
        f"{cell}:6:21: note: others than its owner can {can} the users file {users}: run `chmod 600 {users}`"
    )
    output = "".join(capsys.readouterr())
    assert (told in output) == bool(can)
    assert ("chmod" in output) == bool(can)


@pytest.mark.parametrize(
    ("key", "value", "file"),
    [
        ("opcua.certificates_dir", "pki", "pki/own/key.pem"),
        ("web.certificate", "cert.pem, key: key.pem", "key.pem"),
        ("module.tls.ca_certificate", "ca.pem, certificate: cert.pem, key: key.pem", "key.pem"),
        ("module.tls.ca_certificate", "ca.pem, certificate: both.pem", "both.pem"),
    ],
)
@pytest.mark.parametrize(("mode", "is_open"), [(0o604, True), (0o600, False)])
def test_a_private_key_open_to_others_is_told(
    tmp_path: Path, key: str, value: str, file: str, mode: int, is_open: bool
) -> None:
    for name in ("ca.pem", "cert.pem", "key.pem", "both.pem", file):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch(0o600)
    (tmp_path / file).chmod(mode)
    (tmp_path / "cert.pem").chmod(0o644)  # a certificate is for everybody
    told = [remark.message for remark in exposed_files(read_cell(cell_file(tmp_path, key, value)).settings)]
    assert told == is_open * [
        f"others than its owner can read the private key {tmp_path / file}: run `chmod 600 {tmp_path / file}`"
    ]


def test_the_page_is_told_which_files_grant_access(tmp_path: Path) -> None:
    """It looks at their modes as somebody looks at it."""
    (tmp_path / "key.pem").touch()
    (tmp_path / "cert.pem").touch()
    facts = cell_facts(read_cell(cell_file(tmp_path, "web.certificate", "cert.pem, key: key.pem")), "")
    assert ("private key", tmp_path / "key.pem") in facts.access_files
    assert [what for what, _ in facts.access_files] == ["users file", "private key", "private key"]


def test_a_service_that_starts_warns_of_it_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Two cells may share the file; the one named first is told with it."""
    config = read_cell(with_users(tmp_path, 0o666))
    monkeypatch.setattr(service.log_lines, "configure", lambda: None)
    monkeypatch.setattr(service.asyncio, "run", lambda running: running.close())
    with caplog.at_level(logging.WARNING):
        service.run([config, config])
    (warning,) = caplog.messages
    assert warning.startswith(f"{config.path}:6:21: others than its owner can read and write the users file ")
