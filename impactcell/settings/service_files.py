"""The files that a cell's service works with: users, certificates, journal."""

import contextlib
import os
import shlex
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from cryptography import x509

from impactcell.errors import AccessError
from impactcell.journal.refusal import refusal
from impactcell.opcua.certificates.certificate_dates import ANOTHER_FOR_THE_PAGE, validity_doubt
from impactcell.opcua.certificates.certificate_files import read_certificate
from impactcell.opcua.certificates.own_certificate import (
    CERTIFICATE,
    KEY,
    made_anew,
    read_own_certificate,
    read_own_key,
)
from impactcell.process.path_kind import Kind, kind_at
from impactcell.process.tls_pair import authority_fault, pair_fault
from impactcell.scada.interface import default_application_uri
from impactcell.scada.users import read_users
from impactcell.settings.cells import CellConfig
from impactcell.settings.exposed_files import exposed_files
from impactcell.settings.module_section import TlsSection
from impactcell.settings.remark import Remark

_TLS: Final = ("module", "tls")
"""Where the cell file names the certificates of the link to the module."""
_ANOTHER_FOR_THE_MODULE: Final = (
    "a module that looks at it refuses the connection; put another in its place, which the service uses "
    "from its next connection on"
)
_ANOTHER_AUTHORITY: Final = (
    "a module is refused whose authority's certificate does not hold; put the new one in its place, which "
    "the service uses from its next connection on"
)


def of_service(cell: CellConfig) -> Iterator[Remark]:
    """Say what the service could not use, or nobody would expect, of the files that it works with."""
    settings = cell.settings
    yield from _of_users(settings.opcua.users_file)
    yield from _of_certificates(settings.opcua.certificates_dir)
    if settings.web is not None and settings.web.certificate is not None and settings.web.key is not None:
        yield from _of_pair(("web",), settings.web.certificate, settings.web.key, ANOTHER_FOR_THE_PAGE)
    if settings.module.tls is not None:
        yield from of_module_tls(settings.module.tls)
    yield from exposed_files(settings)
    if settings.journal is not None:
        yield from _of_journal(settings.journal.file, cell.name)
    else:
        yield Remark((), "no journal: what the cell learns is lost with every restart", is_fault=False)


def _of_users(file: Path) -> Iterator[Remark]:
    """Say why nobody can log in; a file that is none of users is a fault, for `run` ends with it."""
    place, add = (
        ("opcua", "users_file"),
        f"`impactcell users add {shlex.quote(str(file))} NAME --role engineer`",
    )
    nobody = f"nobody can log in, over OPC UA or on the page; run {add}"
    if not file.exists():
        yield Remark(place, f"there is no users file {file}: {nobody}", is_fault=False)
    elif _is_barred(file):
        yield Remark(place, f"the users file {file} is not yours to read: not looked at", is_fault=False)
    else:
        try:
            if not read_users(file):
                yield Remark(place, f"the users file {file} holds nobody: {nobody}", is_fault=False)
        except AccessError as error:
            yield Remark(place, f"opcua.users_file: {error}")


def _of_certificates(directory: Path) -> Iterator[Remark]:
    """Say why the OPC UA server could not start with its certificate, and where that does not hold."""
    place = ("opcua", "certificates_dir")
    files = [directory / "own" / name for name in (CERTIFICATE, KEY)]
    try:
        there = [kind_at(file) is not Kind.NOTHING for file in files]
    except OSError:
        yield Remark(place, f"{directory / 'own'} is not yours to read: not looked at", is_fault=False)
        return
    if not any(there):
        return  # both are made at the first start
    unread = [file for file, is_there in zip(files, there, strict=True) if is_there and _is_barred(file)]
    for file in unread:
        yield Remark(place, f"{file} is not yours to read: not looked at", is_fault=False)
    if files[0] in unread:
        return
    try:
        certificate = read_own_certificate(directory, default_application_uri())
        if doubt := validity_doubt(certificate, datetime.now(UTC)):
            yield Remark(place, f"{files[0]}: {doubt}: {made_anew(directory)}", is_fault=False)
        if files[1] not in unread:
            read_own_key(directory, certificate)
    except AccessError as error:
        yield Remark(place, f"opcua.certificates_dir: {error}")


def of_module_tls(tls: TlsSection) -> Iterator[Remark]:
    """Say which certificates an encrypted link to the module could not use, and which do not hold."""
    name, authorities = "ca_certificate", tls.ca_certificate
    place = (*_TLS, name)
    if _is_barred(authorities):
        yield Remark(place, f"{authorities} is not yours to read: not looked at", is_fault=False)
    elif fault := authority_fault(authorities):
        yield Remark(place, f"module.tls.{name}: {fault}")
    else:
        with contextlib.suppress(ValueError):  # TLS may be able to use what cannot be read here
            found = x509.load_pem_x509_certificates(authorities.read_bytes())
            latest = max(found, key=lambda certificate: certificate.not_valid_after_utc)
            if doubt := validity_doubt(latest, datetime.now(UTC)):
                yield Remark(place, f"{authorities}: {doubt}: {_ANOTHER_AUTHORITY}", is_fault=False)
    if tls.certificate is not None:
        yield from _of_pair(_TLS, tls.certificate, tls.key or tls.certificate, _ANOTHER_FOR_THE_MODULE)


def _of_pair(section: tuple[str, ...], certificate: Path, key: Path, another: str) -> Iterator[Remark]:
    """Say why TLS could not use a certificate with its key, and where that does not hold."""
    unread = {file: name for name, file in (("key", key), ("certificate", certificate)) if _is_barred(file)}
    for file, name in unread.items():
        yield Remark((*section, name), f"{file} is not yours to read: not looked at", is_fault=False)
    if not unread and (fault := pair_fault(certificate, key)):
        place = (*section, "certificate" if fault.startswith(f"{certificate}:") else "key")
        yield Remark(place, f"{'.'.join(place)}: {fault}")
    elif certificate not in unread:
        with contextlib.suppress(AccessError):  # TLS may be able to use what cannot be read here
            doubt = validity_doubt(read_certificate(certificate), datetime.now(UTC))
            if doubt:
                yield Remark((*section, "certificate"), f"{certificate}: {doubt}: {another}", is_fault=False)


def _of_journal(file: Path, cell: str) -> Iterator[Remark]:
    """Say why the service could not have its journal there, and where it could not be written."""
    place = ("journal", "file")
    if why := refusal(file, cell):
        yield Remark(place, f"journal.file: {why}")
        return
    own = Path(os.path.realpath(file))
    needed = [own.parent, *(own.with_name(f"{own.name}{end}") for end in ("", "-wal", "-shm", ".lock"))]
    for one in needed:
        if os.path.lexists(one) and not os.access(one, os.W_OK):
            message = f"journal.file: {one} is not yours to write: a service that you start waits until it is"
            yield Remark(place, message, is_fault=False)
            return


def _is_barred(file: Path) -> bool:
    """Whether a file is its owner's alone, who need not be who checks."""
    return not os.access(file, os.R_OK)
