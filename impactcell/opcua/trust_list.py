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
import hashlib
import logging
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa

from impactcell.errors import AccessError
from impactcell.opcua.certificates import make_certificate, own_hosts, write_pair

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


UNREADABLE: Final = (
    ValueError,
    TypeError,
    UnsupportedAlgorithm,
    x509.InvalidVersion,
    x509.DuplicateExtension,
    x509.UnsupportedGeneralNameType,
)
"""What reading a certificate that somebody else has made may raise."""


class UntrustedError(Exception):
    """A certificate that may not connect."""


def thumbprint(certificate: bytes) -> str:
    """SHA-1 thumbprint of a DER certificate in capital hexadecimal, as OPC UA tools show it."""
    return hashlib.sha1(certificate, usedforsecurity=False).hexdigest().upper()


def fingerprint(certificate: bytes) -> str:
    """SHA-256 of a DER certificate in capital hexadecimal, by which the users file knows a certificate."""
    return hashlib.sha256(certificate).hexdigest().upper()


def read_certificate(path: Path) -> x509.Certificate:
    """Read a certificate in PEM or DER.

    Raises
    ------
    AccessError
        The file is absent or holds no certificate.
    """
    try:
        return parse_certificate(path.read_bytes())
    except OSError as error:
        raise AccessError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise AccessError(f"{path}: no certificate in PEM or DER") from error


@lru_cache(maxsize=1024)
def parse_certificate(data: bytes) -> x509.Certificate:
    """Read a certificate in PEM or DER.

    Raises
    ------
    ValueError
        It cannot be read, or has a key that cannot be used.
    """
    is_pem = data.lstrip().startswith(b"-----BEGIN")
    try:
        certificate = (x509.load_pem_x509_certificate if is_pem else x509.load_der_x509_certificate)(data)
        # What is looked at later is read now: each has errors of its own.
        certificate.public_key()
        _ = certificate.signature_hash_algorithm, certificate.subject, certificate.issuer
        _ = certificate.extensions, certificate.not_valid_before_utc, certificate.not_valid_after_utc
    except UNREADABLE as error:
        raise ValueError(f"not a certificate: {error}") from error
    return certificate


@lru_cache(maxsize=64)
def _parse_revocations(data: bytes) -> x509.CertificateRevocationList:
    is_pem = data.lstrip().startswith(b"-----BEGIN")
    try:
        return (x509.load_pem_x509_crl if is_pem else x509.load_der_x509_crl)(data)
    except UNREADABLE as error:
        raise ValueError(f"not a revocation list: {error}") from error


def der(certificate: x509.Certificate) -> bytes:
    """Binary form of a certificate."""
    return certificate.public_bytes(serialization.Encoding.DER)


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
        certificate_path = directory / "own" / "cert.der"
        key_path = directory / "own" / "key.pem"
        if not certificate_path.exists() and not key_path.exists():
            write_pair(directory / "own", *make_certificate("impactcell", application_uri, own_hosts()))
            _log.warning(
                "%s: made a certificate for %s; clients have to trust it", certificate_path, application_uri
            )
        self.certificate = read_certificate(certificate_path)
        self.own_certificate = der(self.certificate)
        if application_uri not in application_uris(self.own_certificate):
            raise AccessError(
                f"{certificate_path}: made for another application URI than {application_uri}; make a new one"
            )
        try:
            private_key = serialization.load_pem_private_key(key_path.read_bytes(), None)
        except OSError as error:
            raise AccessError(
                f"{key_path}: {error.strerror}; put it back, or move cert.der away too: both are made anew"
            ) from error
        except (ValueError, TypeError, UnsupportedAlgorithm) as error:
            raise AccessError(f"{key_path}: no private key in PEM without a passphrase") from error
        if not isinstance(private_key, rsa.RSAPrivateKey) or (
            private_key.public_key().public_numbers() != self._public_numbers()
        ):
            raise AccessError(f"{key_path}: not the RSA key of {certificate_path}")
        self.private_key = private_key

    def _public_numbers(self) -> rsa.RSAPublicNumbers | None:
        key = self.certificate.public_key()
        return key.public_numbers() if isinstance(key, rsa.RSAPublicKey) else None

    @staticmethod
    def is_valid_now(certificate: x509.Certificate) -> bool:
        """Whether the present lies between the two dates of a certificate."""
        now = dt.datetime.now(dt.UTC)
        return certificate.not_valid_before_utc <= now <= certificate.not_valid_after_utc

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
        except UntrustedError:
            self._reject(certificate)
            raise

    def _check(self, certificate: x509.Certificate) -> None:
        if not self.is_valid_now(certificate):
            raise UntrustedError("not valid at this time")
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
        raise UntrustedError("not in `trusted`, nor issued by an authority that is")

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

    def _reject(self, certificate: x509.Certificate) -> None:
        folder = self._directory / "rejected"
        subject = certificate.subject.rfc4514_string()[:MAX_NAME]
        name = "".join(c if c.isascii() and c.isprintable() and c not in "/\\" else "_" for c in subject)
        path = folder / f"{name} [{thumbprint(der(certificate))}].der"
        try:
            rejected = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime)
            for old in rejected[: max(0, len(rejected) - MAX_REJECTED + 1)]:
                old.unlink()
            path.write_bytes(der(certificate))
        except OSError as error:
            _log.warning("%s: cannot keep a rejected certificate: %s", folder, error.strerror)


def first_of_chain(data: bytes) -> bytes:
    """First certificate of a chain that is sent as certificates one after the other (Part 6, 6.2.6).

    Raises
    ------
    ValueError
        The bytes do not begin with a DER sequence.
    """
    if len(data) < 4 or data[0] != 0x30:
        raise ValueError("not DER")
    if data[1] < 0x80:
        return data[: 2 + data[1]]
    count = data[1] & 0x7F
    return data[: 2 + count + int.from_bytes(data[2 : 2 + count], "big")]


def application_uris(data: bytes) -> list[str]:
    """Application URIs that a certificate was made out to."""
    certificate = parse_certificate(first_of_chain(data))
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return []
    return list(names.get_values_for_type(x509.UniformResourceIdentifier))


def _may_issue(certificate: x509.Certificate) -> bool:
    try:
        return certificate.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    except x509.ExtensionNotFound:
        return False
