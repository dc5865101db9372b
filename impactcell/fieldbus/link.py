"""How a module is reached: frozen parameters, no behaviour but the TLS context they make."""

import ssl
from dataclasses import dataclass
from pathlib import Path

from impactcell.errors import LinkError


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


@dataclass(frozen=True, slots=True)
class ModuleLink:
    """Address of a module and what it, or a gateway before it, can stand.

    Attributes
    ----------
    device_id : int
        Modbus unit id; behind a gateway the address on the serial line.
    window : int
        Requests in flight; 1 is safe with any device.
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
    window: int = 1
    max_registers: int = 125
    pause_s: float = 0.0
    timeout_s: float = 0.5
    tls: TlsFiles | None = None

    def __str__(self) -> str:
        """Host, port and device id, for messages."""
        return f"{self.host}:{self.port} device {self.device_id}"
