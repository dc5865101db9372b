"""How a module is reached: frozen parameters, no behaviour but the TLS context they make."""

import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from impactcell.errors import LinkError
from impactcell.fieldbus.hosts import host_identity

NO_NAME: Final = "a host's name has 1 to 63 characters between its dots"
"""Why a name cannot be looked up, nor be that of a certificate: the codec `idna` refuses it."""


@dataclass(frozen=True, slots=True)
class TlsFiles:
    """Modbus/TCP Security: both sides show certificates (PEM files).

    Attributes
    ----------
    ca_certificate : Path
        Certificates that the peer's certificate must lead to.
    certificate, key : Path or None
        Our own certificate and its private key.
    server_name : str or None
        Name that the peer's certificate must carry; None: the host that is connected to.
    """

    ca_certificate: Path
    certificate: Path | None = None
    key: Path | None = None
    server_name: str | None = None

    def context(self) -> ssl.SSLContext:
        """TLS 1.2 or later, with the peer's certificate verified.

        Raises
        ------
        LinkError
            If a file cannot be read or is no certificate.
        """
        try:
            context = ssl.create_default_context(ssl.Purpose.SERVER_AUTH, cafile=str(self.ca_certificate))
            context.minimum_version = ssl.TLSVersion.TLSv1_2
            if self.certificate is not None:
                context.load_cert_chain(self.certificate, self.key)
        except (OSError, ssl.SSLError) as error:
            files = ", ".join(str(path) for path in (self.ca_certificate, self.certificate, self.key) if path)
            raise LinkError(f"TLS files {files} cannot be used: {error}") from error
        return context


_PARITY_BITS: Final = {"N": 0, "E": 1, "O": 1}
"""Bits of a character for each parity: none, even, odd."""
_RTU_SILENCE: Final = 3.5
"""Characters of silence that end an RTU frame (Modbus over Serial Line V1.02, section 2.5.1.1)."""
_RTU_SILENCE_FAST_S: Final = 1.75e-3
"""The same above 19 200 baud, where it does not shrink any more (ibid.)."""
_FAST_BAUD: Final = 19_200
"""Baud rate from which on that holds (ibid.)."""


@dataclass(frozen=True, slots=True)
class SerialLine:
    """A serial line and how characters are sent on it.

    Attributes
    ----------
    device : str
        The port, as in /dev/ttyUSB0 or COM3.
    baudrate : int
        Bits a second.
    parity : str
        N, E or O.
    stop_bits, data_bits : int
        RTU has eight data bits.
    """

    device: str
    baudrate: int = 19_200
    parity: str = "E"
    stop_bits: int = 1
    data_bits: int = 8

    @property
    def character_s(self) -> float:
        """Time that one character takes: start bit, data, parity and stop bits."""
        return (1 + self.data_bits + _PARITY_BITS[self.parity] + self.stop_bits) / self.baudrate

    @property
    def silence_s(self) -> float:
        """Silence between frames."""
        return _RTU_SILENCE_FAST_S if self.baudrate > _FAST_BAUD else _RTU_SILENCE * self.character_s

    def __str__(self) -> str:
        """Port and settings, for messages."""
        return f"{self.device} at {self.baudrate} baud {self.data_bits}{self.parity}{self.stop_bits}"


@dataclass(frozen=True, slots=True)
class ModuleLink:
    """Address of a module and what it, or a gateway before it, can stand.

    Attributes
    ----------
    transport : str
        What a request travels on: `tcp`, the same encrypted (`tls`) or in datagrams (`udp`), RTU frames over
        TCP (`rtu_over_tcp`), or a serial line (`rtu`).
    serial : SerialLine or None
        The line of transport `rtu`, in the place of host and port.
    device_id : int
        Modbus unit id; behind a gateway the address on the serial line.
    window : int or None
        Requests in flight over Modbus TCP; None: found by trials, see `RequestWindow`.
    max_registers : int
        Registers asked for at once, at most 125.
    pause_s : float
        Rest between a reply and the next request.
    timeout_s : float
        Without an answer for so long the connection is closed, as is one that takes longer to be made. Of
        several requests in flight each may take so long after the reply before it.
    tls : TlsFiles or None
        Encrypted link.
    """

    host: str = "127.0.0.1"
    port: int = 502
    device_id: int = 1
    window: int | None = None
    max_registers: int = 125
    pause_s: float = 0.0
    timeout_s: float = 0.5
    tls: TlsFiles | None = None
    transport: str = "tcp"
    serial: SerialLine | None = None

    @property
    def endpoint(self) -> tuple[str, int]:
        """What leads to the same endpoint shares one connection: host and port, or the serial port and 0."""
        return (host_identity(self.host), self.port) if self.serial is None else (self.serial.device, 0)

    @property
    def patience(self) -> str:
        """How long is waited, and the key that says so, for messages."""
        return f"{1e3 * self.timeout_s:g} ms (timeout_ms)"

    def __str__(self) -> str:
        """Where and which device, for messages."""
        if self.serial is not None:
            return f"{self.serial} device {self.device_id}"
        kind = "" if self.transport == "tcp" else f" ({self.transport.replace('_', ' ')})"
        return f"{self.host}:{self.port}{kind} device {self.device_id}"
