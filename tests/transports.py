"""A device behind every kind of transport, for what all of them must keep."""

import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.fieldbus.link import ModuleLink, SerialLine, TlsFiles
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import WIRE, Words
from impactcell.fieldbus.transports import transport_for
from simulator.answers import RegisterDevice
from simulator.faults import FaultInjector
from simulator.modbus_server import ModbusServer
from simulator.rtu_over_tcp import RtuOverTcpServer
from simulator.serial_line import SerialServer
from simulator.udp_server import UdpServer
from tests.certificates import Authority

KINDS = ("tcp", "tls", "udp", "rtu_over_tcp", "rtu")
STREAMS = ("tcp", "tls", "rtu_over_tcp", "rtu")
"""Those that carry bytes, not datagrams."""
SILENT_S = 30.0
"""A timeout that no test waits for."""


class Image:
    """65 000 registers, each showing its address, as many coils and discrete inputs, and who made it."""

    def __init__(self) -> None:
        self.words = np.arange(65_536).astype(WIRE)
        self.bits = {table: bits_of(seed) for seed, table in enumerate(("coil", "discrete"))}
        self.identification = {
            0: "Works",
            1: "M-17",
            2: "3.4",
            4: "Measuring module",
            5: "ü" * 60,
            6: "x" * 90,
        }
        self.busy = 0
        self.writes: list[tuple[int, list[int]]] = []

    def read(self, table: str, address: int, count: int) -> Words:
        if self.busy:
            self.busy -= 1
            raise BlockingIOError
        if address + count > 65_000:
            raise LookupError(address)
        if table in self.bits:
            return self.bits[table][address : address + count]
        return self.words[address : address + count]

    def write(self, address: int, words: Words) -> None:
        self.writes.append((address, words.tolist()))
        self.words[address : address + words.size] = words

    def write_coils(self, address: int, bits: Words) -> None:
        self.writes.append((address, bits.tolist()))
        self.bits["coil"][address : address + bits.size] = bits


def bits_of(seed: int) -> Words:
    """65 536 bits that a shift or another order would change."""
    return np.random.default_rng(seed).integers(0, 2, 65_536).astype(WIRE)


def server_for(
    kind: str, device: RegisterDevice, directory: Path, faults: FaultInjector | None = None
) -> tuple[ModbusServer, TlsFiles | None]:
    """A server of this kind of transport, and what a client needs to know of its certificates."""
    if kind == "rtu":
        return SerialServer(device, faults=faults), None
    if kind == "udp":
        return UdpServer(device, faults=faults), None
    if kind == "rtu_over_tcp":
        return RtuOverTcpServer(device, faults=faults), None
    if kind == "tcp":
        return ModbusServer(device, faults=faults), None
    authority = Authority(directory, "plant")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(*authority.issue("module"))
    context.load_verify_locations(authority.file)
    context.verify_mode = ssl.CERT_REQUIRED
    files = TlsFiles(authority.file, *authority.issue("service"), server_name="module.test")
    return ModbusServer(device, faults=faults, tls=context), files


def link_to(
    kind: str, server: ModbusServer, tls: TlsFiles | None, timeout_s: float = SILENT_S, **link: Any
) -> ModuleLink:
    """How that server is reached."""
    serial = SerialLine(server.device_file, 115_200, parity="N") if isinstance(server, SerialServer) else None
    return ModuleLink(
        port=server.port or 502, transport=kind, serial=serial, tls=tls, timeout_s=timeout_s, **link
    )


@asynccontextmanager
async def connected(
    kind: str, device: RegisterDevice, directory: Path, faults: FaultInjector | None = None, **link: Any
) -> AsyncIterator[tuple[ModbusServer, ModbusClient]]:
    """Serve a device, and connect to it."""
    server, tls = server_for(kind, device, directory, faults)
    async with server:
        client = ModbusClient(transport_for(link_to(kind, server, tls, **link)))
        await client.connect()
        try:
            yield server, client
        finally:
            await client.close()
