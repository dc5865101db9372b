"""Modbus/TCP Security: both sides show certificates, and nothing is said to a stranger."""

import asyncio
import ssl
from pathlib import Path

import numpy as np
import pytest

from impactcell.errors import LinkError
from impactcell.fieldbus.link import ModuleLink, TlsFiles
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import WIRE, Words
from impactcell.fieldbus.transports import transport_for
from simulator.modbus_server import ModbusServer
from tests.certificates import Authority


class Image:
    def read(self, table: str, address: int, count: int) -> Words:
        return np.arange(address, address + count).astype(WIRE)

    def write(self, address: int, words: Words) -> None:
        raise LookupError(address)


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


async def test_a_module_that_never_answers_a_handshake_is_not_reached(tmp_path: Path) -> None:
    """It takes the connection and is silent, as one does that speaks no TLS."""
    authority = Authority(tmp_path, "plant")
    tls = TlsFiles(authority.file, *authority.issue("service"))
    async with await asyncio.start_server(_silent, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        client = ModbusClient(transport_for(ModuleLink(port=port, transport="tls", timeout_s=0.3, tls=tls)))
        with pytest.raises(LinkError, match=f"127.0.0.1:{port}"):
            await client.connect()
        assert not client.connected
        await client.close()


async def _silent(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    await reader.read(-1)
    writer.close()
