"""Certificates: the server's own, and the list of those it trusts.

::

    pki/
      own/cert.der            the server's certificate, for clients to trust
      own/key.pem             its private key
      trusted/                certificates that may connect, and authorities whose certificates may
      issuers/                authorities that are needed to complete a chain but are not trusted themselves
      revoked/                certificate revocation lists of authorities
      rejected/               certificates that were refused, for review

Every check looks at the folders anew: a certificate moved from `rejected` to `trusted` may connect at once.
DER and PEM are both read, whatever the file is called.
"""

import datetime as dt
import logging
import shlex
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import rsa

from impactcell.errors import AccessError
from impactcell.opcua.certificates.certificate_dates import CertificateWatch, validity_mark
from impactcell.opcua.certificates.certificate_files import (
    UNREADABLE,
    der,
    first_of_chain,
    parse_certificate,
    thumbprint,
)
from impactcell.opcua.certificates.making import make_certificate, own_hosts, write_pair
from impactcell.opcua.certificates.own_certificate import (
    CERTIFICATE,
    KEY,
    made_anew,
    read_own_certificate,
    read_own_key,
)

_log = logging.getLogger(__name__)

FOLDERS: Final = ("own", "trusted", "issuers", "revoked", "rejected")
MAX_REJECTED: Final = 100
"""Refused certificates kept for review."""
MAX_NAME: Final = 80
"""Longest part of a subject in the name of a file, characters."""
MIN_KEY_BITS: Final = 2048
"""Shortest RSA key of the policies on offer (Part 7)."""
MAX_CHAIN_LENGTH: Final = 5
"""Certificates from a client's to a trusted authority."""


_NOT_TRUSTED: Final = "not in `trusted`, nor issued by an authority that is"


class UntrustedError(Exception):
    """A certificate that may not connect."""


@lru_cache(maxsize=64)
def _parse_revocations(data: bytes) -> x509.CertificateRevocationList:
    is_pem = data.lstrip().startswith(b"-----BEGIN")
    try:
        return (x509.load_pem_x509_crl if is_pem else x509.load_der_x509_crl)(data)
    except UNREADABLE as error:
        raise ValueError(f"not a revocation list: {error}") from error


def is_revocation_list(path: Path) -> bool:
    """Whether a file is a list that a folder `revoked` is for."""
    try:
        _parse_revocations(path.read_bytes())
    except (OSError, ValueError):
        return False
    return True


def make_folders(directory: Path) -> None:
    """Make the folders of a pki directory, those that are not there; raises `AccessError` if it cannot."""
    for folder in FOLDERS:
        try:
            (directory / folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise AccessError(f"{directory / folder}: {error.strerror}") from error


class TrustList:
    """The folders of a pki directory; made with a new certificate where there is none.

    Raises
    ------
    AccessError
        The server's own certificate or key is absent, does not fit or cannot be read.
    """

    def __init__(self, directory: Path, application_uri: str) -> None:
        self._directory = directory
        make_folders(directory)
        own = directory / "own"
        if not (own / CERTIFICATE).exists() and not (own / KEY).exists():
            write_pair(own, *make_certificate("impactcell", application_uri, own_hosts()))
            _log.warning(
                "%s: made a certificate for %s; clients have to trust it", own / CERTIFICATE, application_uri
            )
        self.certificate = read_own_certificate(directory, application_uri)
        self.own_certificate = der(self.certificate)
        self.private_key = read_own_key(directory, self.certificate)
        self._watch = CertificateWatch(self.certificate, own / CERTIFICATE, made_anew(directory))

    def look_at_own(self, now: dt.datetime) -> None:
        """Tell in the log, once a day, where the server's own certificate does not hold, or soon will not."""
        self._watch.look(now)

    @staticmethod
    def is_valid_now(certificate: x509.Certificate) -> bool:
        """Whether the present lies between the two dates of a certificate."""
        return not validity_mark(certificate, dt.datetime.now(dt.UTC))

    def check(self, data: bytes) -> None:
        """Check a client's certificate, the first where a chain is sent; keep it in `rejected` if it fails.

        Raises
        ------
        UntrustedError
            With the reason, for the log.
        """
        try:
            certificate = parse_certificate(first_of_chain(data))
        except ValueError as error:
            raise UntrustedError("not a certificate") from error
        try:
            self._check(certificate)
        except UntrustedError as error:
            kept = self._reject(certificate)
            way = f"; look at it, and let it in with `impactcell certs trust {shlex.quote(str(kept))}`"
            helps = kept is not None and str(error) == _NOT_TRUSTED
            raise UntrustedError(f"{_name(certificate)}: {error}{way if helps else ''}") from error

    def _check(self, certificate: x509.Certificate) -> None:
        if not self.is_valid_now(certificate):
            begin, end = certificate.not_valid_before_utc, certificate.not_valid_after_utc
            raise UntrustedError(f"not valid at this time, but from {begin:%Y-%m-%d} to {end:%Y-%m-%d}")
        key = certificate.public_key()
        if not isinstance(key, rsa.RSAPublicKey) or key.key_size < MIN_KEY_BITS:
            raise UntrustedError(f"not an RSA key of {MIN_KEY_BITS} bits or more")
        if isinstance(certificate.signature_hash_algorithm, hashes.SHA1 | hashes.MD5):
            raise UntrustedError("signed with SHA-1 or MD5")
        trusted = {der(trusted_certificate) for trusted_certificate in self._certificates("trusted")}
        if self._is_revoked(certificate):
            raise UntrustedError("revoked")
        current = certificate
        for _ in range(MAX_CHAIN_LENGTH):
            if der(current) in trusted:
                return
            issuer = self._issuer_of(current)
            if issuer is None or der(issuer) == der(current):
                break
            if self._is_revoked(issuer):
                raise UntrustedError("an authority of its chain is revoked")
            current = issuer
        raise UntrustedError(_NOT_TRUSTED)

    def _issuer_of(self, certificate: x509.Certificate) -> x509.Certificate | None:
        for folder in ("trusted", "issuers"):
            for candidate in self._certificates(folder):
                if candidate.subject != certificate.issuer or not _may_issue(candidate):
                    continue
                try:
                    certificate.verify_directly_issued_by(candidate)
                except (*UNREADABLE, InvalidSignature):
                    continue
                return candidate
        return None

    def _is_revoked(self, certificate: x509.Certificate) -> bool:
        for _, data in self._files("revoked"):
            try:
                revocations = _parse_revocations(data)
            except ValueError:
                continue
            issued = revocations.issuer == certificate.issuer
            if issued and revocations.get_revoked_certificate_by_serial_number(certificate.serial_number):
                return True
        return False

    def _certificates(self, folder: str) -> Iterator[x509.Certificate]:
        for path, data in self._files(folder):
            try:
                yield parse_certificate(data)
            except ValueError:
                _log.warning("%s: no certificate in PEM or DER; ignored", path)

    def _files(self, folder: str) -> Iterator[tuple[Path, bytes]]:
        for path in sorted((self._directory / folder).iterdir()):
            if path.is_file() and not path.name.startswith("."):
                yield path, path.read_bytes()

    def _reject(self, certificate: x509.Certificate) -> Path | None:
        folder = self._directory / "rejected"
        path = folder / f"{_name(certificate)}.der"
        try:
            rejected = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime)
            for old in rejected[: max(0, len(rejected) - MAX_REJECTED + 1)]:
                old.unlink()
            path.write_bytes(der(certificate))
        except OSError as error:
            _log.warning("%s: cannot keep a rejected certificate: %s", folder, error.strerror)
            return None
        return path


def _name(certificate: x509.Certificate) -> str:
    """Name a certificate by its subject and its thumbprint, as a file may be called."""
    subject = certificate.subject.rfc4514_string()[:MAX_NAME]
    name = "".join(c if c.isascii() and c.isprintable() and c not in "/\\" else "_" for c in subject)
    return f"{name} [{thumbprint(der(certificate))}]"


def _may_issue(certificate: x509.Certificate) -> bool:
    try:
        return certificate.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    except x509.ExtensionNotFound:
        return False
