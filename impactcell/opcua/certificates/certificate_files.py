"""Certificates as they lie in files, and by which short names they are known."""

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization

from impactcell.errors import AccessError

UNREADABLE: Final = (
    ValueError,
    TypeError,
    UnsupportedAlgorithm,
    x509.InvalidVersion,
    x509.DuplicateExtension,
    x509.UnsupportedGeneralNameType,
)
"""What reading a certificate that somebody else has made may raise."""


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


def der(certificate: x509.Certificate) -> bytes:
    """Binary form of a certificate."""
    return certificate.public_bytes(serialization.Encoding.DER)


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
