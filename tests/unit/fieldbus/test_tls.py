"""Modbus/TCP Security: both sides show certificates, and nothing is said to a stranger."""

import datetime as dt
import ipaddress
import ssl
from pathlib import Path

import numpy as np
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from impactcell.errors import LinkError
from impactcell.fieldbus.link import ModuleLink, TlsFiles
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import WIRE, Words
from impactcell.fieldbus.transports import transport_for
from simulator.modbus_server import ModbusServer


class Image:
    def read(self, table: str, address: int, count: int) -> Words:
        return np.arange(address, address + count).astype(WIRE)

    def write(self, address: int, words: Words) -> None:
        raise LookupError(address)


class Authority:
    """A certificate authority that lives as long as the test."""

    def __init__(self, directory: Path, name: str) -> None:
        self.directory = directory
        self.key = ec.generate_private_key(ec.SECP256R1())
        self.name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
        self.certificate = self._sign(self.name, self.key, ca=True)
        self.file = directory / f"{name}.pem"
        self.file.write_bytes(self.certificate.public_bytes(serialization.Encoding.PEM))

    def _sign(self, subject: x509.Name, key: ec.EllipticCurvePrivateKey, *, ca: bool) -> x509.Certificate:
        now = dt.datetime.now(dt.UTC)
        builder = (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(self.name)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - dt.timedelta(days=1))
            .not_valid_after(now + dt.timedelta(days=1))
            .add_extension(x509.BasicConstraints(ca=ca, path_length=None), critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
            .add_extension(
                x509.AuthorityKeyIdentifier.from_issuer_public_key(self.key.public_key()), critical=False
            )
        )
        if ca:
            usage = {"digital_signature": True, "key_cert_sign": True, "crl_sign": True}
            others = ("content_commitment", "key_encipherment", "data_encipherment", "key_agreement")
            builder = builder.add_extension(
                x509.KeyUsage(**usage, **dict.fromkeys((*others, "encipher_only", "decipher_only"), False)),
                critical=True,
            )
        else:
            address = x509.IPAddress(ipaddress.ip_address("127.0.0.1"))
            builder = builder.add_extension(
                x509.SubjectAlternativeName([address, x509.DNSName("module.test")]), critical=False
            )
        return builder.sign(self.key, hashes.SHA256())

    def issue(self, name: str) -> tuple[Path, Path]:
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
        certificate, private = self.directory / f"{name}-cert.pem", self.directory / f"{name}-key.pem"
        certificate.write_bytes(self._sign(subject, key, ca=False).public_bytes(serialization.Encoding.PEM))
        private.write_bytes(
            key.private_bytes(
                serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
            )
        )
        return certificate, private


def serving(authority: Authority) -> ModbusServer:
    """A module that wants to see a certificate of its own authority."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(*authority.issue("module"))
    context.load_verify_locations(authority.file)
    context.verify_mode = ssl.CERT_REQUIRED
    return ModbusServer(Image(), tls=context)


@pytest.mark.parametrize("window", [1, 16])
@pytest.mark.parametrize("server_name", [None, "module.test"])
async def test_blocks_come_over_tls(tmp_path: Path, window: int, server_name: str | None) -> None:
    authority = Authority(tmp_path, "plant")
    tls = TlsFiles(authority.file, *authority.issue("service"), server_name=server_name)
    async with serving(authority) as server:
        client = ModbusClient(
            transport_for(ModuleLink(port=server.port, window=window, timeout_s=5.0, tls=tls))
        )
        await client.connect()
        assert np.array_equal(await client.read(5, 20_000), np.arange(5, 20_005))
        await client.close()


async def test_a_module_of_another_authority_is_refused(tmp_path: Path) -> None:
    authority, other = Authority(tmp_path, "plant"), Authority(tmp_path, "other")
    tls = TlsFiles(other.file, *authority.issue("service"))
    async with serving(authority) as server:
        client = ModbusClient(transport_for(ModuleLink(port=server.port, timeout_s=5.0, tls=tls)))
        with pytest.raises(LinkError, match=r"(?i)certificate verify failed"):
            await client.connect()
        await client.close()


async def test_a_module_of_another_name_is_refused(tmp_path: Path) -> None:
    authority = Authority(tmp_path, "plant")
    tls = TlsFiles(authority.file, *authority.issue("service"), server_name="pump.test")
    async with serving(authority) as server:
        client = ModbusClient(transport_for(ModuleLink(port=server.port, timeout_s=5.0, tls=tls)))
        with pytest.raises(LinkError, match=r"(?i)certificate verify failed"):
            await client.connect()
        await client.close()


async def test_without_our_certificate_the_module_says_nothing(tmp_path: Path) -> None:
    authority = Authority(tmp_path, "plant")
    async with serving(authority) as server:
        client = ModbusClient(
            transport_for(ModuleLink(port=server.port, timeout_s=5.0, tls=TlsFiles(authority.file)))
        )

        async def ask() -> None:
            await client.connect()  # TLS 1.3: the refusal comes with the first answer
            await client.read(0, 1)

        with pytest.raises(LinkError):
            await ask()
        await client.close()


async def test_plain_text_to_a_tls_module_is_a_link_error(tmp_path: Path) -> None:
    authority = Authority(tmp_path, "plant")
    async with serving(authority) as server:
        client = ModbusClient(transport_for(ModuleLink(port=server.port, timeout_s=5.0)))
        await client.connect()
        with pytest.raises(LinkError):
            await client.read(0, 1)
        await client.close()


def test_files_that_are_no_certificates_are_named(tmp_path: Path) -> None:
    nonsense = tmp_path / "nonsense.pem"
    nonsense.write_text("nothing", encoding="utf-8")
    with pytest.raises(LinkError, match=r"nonsense\.pem cannot be used"):
        TlsFiles(nonsense).context()
    with pytest.raises(LinkError, match=r"absent\.pem cannot be used"):
        TlsFiles(tmp_path / "absent.pem").context()
