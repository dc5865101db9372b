"""Certificates of the link to the module that TLS cannot use, or that do not hold, are told by `check`."""

import datetime as dt
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.serialization import Encoding

from impactcell.settings import read_cell
from impactcell.settings.judgement import CellFinding, judge_cell
from tests.certificates import Authority, self_signed
from tests.unit.settings.test_impossible_paths import cell_file

NOW = dt.datetime.now(dt.UTC)
DAY = dt.timedelta(days=1)


def judged(directory: Path, ca: Path, **own: Path) -> list[CellFinding]:
    files = ", ".join([str(ca), *(f"{name}: {file}" for name, file in own.items())])
    cell = cell_file(directory, "module.tls.ca_certificate", files)
    found = [one for one in judge_cell(read_cell(cell)) if "note: " not in str(one) or "pem" in one.message]
    return [one for one in found if "chmod" not in one.message]  # see test_exposed_files


def lasting(directory: Path, days: int = 100, form: Encoding = Encoding.PEM) -> tuple[Path, Path]:
    return self_signed(directory, "urn:module", NOW - 100 * DAY, NOW + days * DAY, form)


@pytest.mark.parametrize("content", [b"", b"x", b"-----BEGIN CERTIFICATE-----\nx\n-----END CERTIFICATE-----"])
def test_an_authority_that_is_none(tmp_path: Path, content: bytes) -> None:
    ca = tmp_path / "ca.pem"
    ca.write_bytes(content)
    (fault,) = judged(tmp_path, ca)
    assert fault.is_fault
    assert fault.message.startswith(f"module.tls.ca_certificate: {ca}: holds no certificate in PEM, which is")
    told = str(fault).removeprefix(f"{fault.path}:").partition(":")
    line = fault.path.read_text(encoding="utf-8").splitlines()[int(told[0]) - 1]
    assert line[int(told[2].partition(":")[0]) - 1 :].startswith(str(ca))


def _other_key(_: Path, key: Path) -> None:
    shutil.move(lasting(key.parent / "other")[1], key)


def _changed_places(certificate: Path, key: Path) -> None:
    key.write_bytes(certificate.read_bytes())


def _der(certificate: Path, _: Path) -> None:
    shutil.move(lasting(certificate.parent / "der", form=Encoding.DER)[0], certificate)


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (_der, "certificate: {0}/cert.pem: holds no certificate in PEM, which is needed; `openssl x509 "),
        (_other_key, "key: {0}/key.pem: is not the private key of {0}/cert.pem; name the two that belong"),
        (_changed_places, "key: {0}/key.pem: holds no private key in PEM, which is needed; `openssl pkey "),
    ],
)
def test_our_own_that_tls_cannot_use(tmp_path: Path, spoil: Callable[[Path, Path], None], told: str) -> None:
    ca, _ = lasting(tmp_path / "plant")
    certificate, key = lasting(tmp_path / "own")
    spoil(certificate, key)
    (fault,) = judged(tmp_path, ca, certificate=certificate, key=key)
    assert fault.is_fault
    assert fault.message.startswith(f"module.tls.{told.format(tmp_path / 'own')}")


def test_a_key_in_the_file_of_its_certificate(tmp_path: Path) -> None:
    ca, _ = lasting(tmp_path / "plant")
    certificate, key = lasting(tmp_path / "own")
    (fault,) = judged(tmp_path, ca, certificate=certificate)
    assert fault.message == (
        f"module.tls.certificate: {certificate}: holds no private key beside the certificate; name that as "
        "`key`"
    )
    certificate.write_bytes(certificate.read_bytes() + key.read_bytes())
    assert not judged(tmp_path, ca, certificate=certificate)


@pytest.mark.parametrize(
    ("days", "told"), [(-2, "ended on {:%Y-%m-%d}: "), (29, "ends on {:%Y-%m-%d}: "), (31, "")]
)
def test_what_has_ended_is_a_note(tmp_path: Path, days: int, told: str) -> None:
    ca, _ = lasting(tmp_path / "plant", days)
    certificate, key = lasting(tmp_path / "own", days)
    notes = judged(tmp_path, ca, certificate=certificate, key=key)
    expected = [f"{file}: {told.format(NOW + days * DAY)}" for file in (ca, certificate)] * bool(told)
    assert [note.message[: len(said)] for note, said in zip(notes, expected, strict=True)] == expected
    assert not any(note.is_fault for note in notes)


def test_authorities_of_which_one_lasts(tmp_path: Path) -> None:
    ended, lasts = lasting(tmp_path / "a", -2)[0], lasting(tmp_path / "b")[0]
    ended.write_bytes(ended.read_bytes() + lasts.read_bytes())
    assert not judged(tmp_path, ended)


def test_what_a_plant_issues_is_no_fault(tmp_path: Path) -> None:
    authority = Authority(tmp_path, "plant")
    certificate, key = authority.issue("service")
    notes = judged(tmp_path, authority.file, certificate=certificate, key=key)
    assert not any(note.is_fault for note in notes)
