"""A certificate of the page that cannot be used, or has ended, is told by `check` as by `run`."""

import datetime as dt
import shutil
from collections.abc import Callable
from pathlib import Path
from time import sleep

import pytest
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    PrivateFormat,
    load_pem_private_key,
)

from impactcell.errors import SettingsError
from impactcell.settings import read_cell
from impactcell.settings.judgement import CellFinding, judge_cell
from impactcell.web.interface import CellFacts, PageSettings
from impactcell.web.server import PageServer
from tests.certificates import self_signed
from tests.unit.settings.test_impossible_paths import cell_file
from tests.unit.web.page import CELL, Backend

NOW = dt.datetime.now(dt.UTC)
DAY = dt.timedelta(days=1)


def pair(directory: Path, end: dt.datetime, form: Encoding = Encoding.PEM) -> tuple[Path, Path]:
    return self_signed(directory, "urn:page", NOW - 100 * DAY, end, form)


def served(directory: Path, certificate: Path, key: Path) -> PageServer:
    users = directory / "users.yaml"
    settings = PageSettings(
        "https://127.0.0.1:0", users, directory / "pki", directory / "studies", certificate, key
    )
    return PageServer(settings, [CellFacts(CELL, "m", "o")], Backend(users))


def judged(directory: Path, certificate: Path, key: Path) -> list[CellFinding]:
    cell = cell_file(directory, "web.certificate", f"{certificate}, key: {key}")
    return [one for one in judge_cell(read_cell(cell)) if one.section == "web"]


def _der(certificate: Path, _: Path) -> None:
    made, _ = pair(certificate.parent / "der", NOW + 100 * DAY, Encoding.DER)
    shutil.move(made, certificate)


def _other_key(_: Path, key: Path) -> None:
    _, other = pair(key.parent / "other", NOW + 100 * DAY)
    shutil.move(other, key)


def _no_key(certificate: Path, key: Path) -> None:
    key.write_bytes(b"x")


def _passphrase(_: Path, key: Path) -> None:
    secret = load_pem_private_key(key.read_bytes(), None)
    key.write_bytes(secret.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"x")))


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (_der, "certificate: {}/cert.pem: holds no certificate in PEM, which is needed; `openssl x509 "),
        (_other_key, "key: {0}/key.pem: is not the private key of {0}/cert.pem; name the two that belong"),
        (_no_key, "key: {}/key.pem: holds no private key in PEM, which is needed; `openssl pkey "),
        (_passphrase, "key: {}/key.pem: has a passphrase, for which a service cannot be asked; `openssl "),
    ],
)
def test_what_tls_cannot_use(tmp_path: Path, spoil: Callable[[Path, Path], None], told: str) -> None:
    files = pair(tmp_path, NOW + 100 * DAY)
    spoil(*files)
    (fault,) = judged(tmp_path, *files)
    assert fault.is_fault
    key, _, message = told.format(tmp_path).partition(": ")
    assert fault.message.startswith(f"web.{key}: {message}")
    with pytest.raises(SettingsError) as refused:
        served(tmp_path, *files).start()
    assert str(refused.value) == f"page: {fault.message.removeprefix(f'web.{key}: ')}"


@pytest.mark.parametrize(
    ("days", "told"), [(-2, "ended on {:%Y-%m-%d}: browsers refuse"), (29, "ends on {:%Y-%m-%d}: "), (31, "")]
)
def test_one_that_has_ended(tmp_path: Path, caplog: pytest.LogCaptureFixture, days: int, told: str) -> None:
    files = pair(tmp_path, NOW + days * DAY)
    message = f"{files[0]}: {told.format(NOW + days * DAY)}"
    notes = judged(tmp_path, *files)
    assert [one.message.startswith(message) for one in notes] == [True] * bool(told)
    assert not any(one.is_fault for one in notes)
    page = served(tmp_path, *files)
    page.start()
    while told and not any(line.startswith(message) for line in caplog.messages):
        sleep(0)
    page.stop()
    assert len([line for line in caplog.messages if "cert.pem" in line]) == bool(told)
