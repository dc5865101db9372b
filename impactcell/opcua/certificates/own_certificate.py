"""The server's own certificate and key, read as the server uses them."""

import shlex
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import rsa

from impactcell.errors import AccessError
from impactcell.opcua.certificates.certificate_files import application_uris, der, read_certificate

CERTIFICATE: Final = "cert.der"
"""The server's certificate, in the folder `own`."""
KEY: Final = "key.pem"
"""Its private key, beside it."""


def made_anew(directory: Path) -> str:
    """Say how the server gets another certificate."""
    return (
        f"move {CERTIFICATE} and {KEY} out of {directory / 'own'} and run "
        f"`impactcell certs make {shlex.quote(str(directory))}`; clients have to trust the new one, which "
        "the service uses from its next start on"
    )


def read_own_certificate(directory: Path, application_uri: str) -> x509.Certificate:
    """Read the server's certificate.

    Raises
    ------
    AccessError
        It is absent, cannot be read or is made for another application.
    """
    path = directory / "own" / CERTIFICATE
    try:
        certificate = read_certificate(path)
    except AccessError as error:
        raise AccessError(f"{error}; put it back, or {made_anew(directory)}") from error
    if application_uri not in application_uris(der(certificate)):
        raise AccessError(
            f"{path}: made for another application URI than {application_uri}; {made_anew(directory)}"
        )
    return certificate


def read_own_key(directory: Path, certificate: x509.Certificate) -> rsa.RSAPrivateKey:
    """Read the private key of the server's certificate.

    Raises
    ------
    AccessError
        It is absent, cannot be read or belongs to another certificate.
    """
    path, beside = directory / "own" / KEY, directory / "own" / CERTIFICATE
    public_key = certificate.public_key()
    try:
        private_key = serialization.load_pem_private_key(path.read_bytes(), None)
    except OSError as error:
        raise AccessError(
            f"{path}: {error.strerror}; put it back, or move {CERTIFICATE} away too: both are made anew"
        ) from error
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise AccessError(
            f"{path}: no private key in PEM without a passphrase; put it back, or {made_anew(directory)}"
        ) from error
    if (
        not isinstance(private_key, rsa.RSAPrivateKey)
        or not isinstance(public_key, rsa.RSAPublicKey)
        or private_key.public_key().public_numbers() != public_key.public_numbers()
    ):
        raise AccessError(f"{path}: not the RSA key of {beside}; put that back, or {made_anew(directory)}")
    return private_key
