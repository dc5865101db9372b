"""Making certificates as OPC UA wants them (Part 6, 6.2.2)."""

import datetime as dt
import ipaddress
import os
import socket
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from impactcell.errors import AccessError

KEY_BITS: Final = 2048
"""The least that policies with SHA-256 take, and the most that every client does (Part 7)."""
VALID_DAYS: Final = 5 * 365
"""Days a certificate holds: five years, renewed with the machine's first overhaul."""


def make_certificate(
    common_name: str, application_uri: str, hosts: Sequence[str], days: int = VALID_DAYS
) -> tuple[x509.Certificate, rsa.RSAPrivateKey]:
    """Make a self-signed certificate for an OPC UA application.

    Parameters
    ----------
    application_uri : str
        Must be the URI the application calls itself by.
    hosts : sequence of str
        Names and addresses it is reached under.
    """
    key = rsa.generate_private_key(public_exponent=65537, key_size=KEY_BITS)
    name = x509.Name(
        [
            x509.NameAttribute(NameOID.COMMON_NAME, common_name),
            x509.NameAttribute(NameOID.ORGANIZATION_NAME, "impactcell"),
        ]
    )
    now = dt.datetime.now(dt.UTC)
    names: list[x509.GeneralName] = [x509.UniformResourceIdentifier(application_uri)]
    for host in hosts:
        try:
            names.append(x509.IPAddress(ipaddress.ip_address(host)))
        except ValueError:
            names.append(x509.DNSName(host.encode("idna").decode()))
    usage = x509.KeyUsage(
        digital_signature=True,
        content_commitment=True,
        key_encipherment=True,
        data_encipherment=True,
        key_agreement=False,
        key_cert_sign=True,
        crl_sign=False,
        encipher_only=False,
        decipher_only=False,
    )
    purposes = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - dt.timedelta(days=1))
        .not_valid_after(now + dt.timedelta(days=days))
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    return certificate, key


def own_hosts() -> list[str]:
    """Names and addresses of this machine that clients are likely to use."""
    return list(dict.fromkeys([socket.gethostname(), "localhost", "127.0.0.1"]))


def write_pair(directory: Path, certificate: x509.Certificate, key: rsa.RSAPrivateKey) -> tuple[Path, Path]:
    """Write `cert.der` and `key.pem`; the key can be read by its owner only. Nothing is overwritten.

    Raises
    ------
    AccessError
        A file is there already, or cannot be written.
    """
    certificate_path, key_path = directory / "cert.der", directory / "key.pem"
    for path in (certificate_path, key_path):
        if path.exists():
            raise AccessError(f"{path}: is there already; remove it if a new certificate is wanted")
    pem = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(key_path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(pem)
        certificate_path.write_bytes(certificate.public_bytes(serialization.Encoding.DER))
    except OSError as error:
        raise AccessError(f"{directory}: cannot be written: {error.strerror}") from error
    return certificate_path, key_path
