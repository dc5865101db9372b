"""The measuring module in a cell file: how it is reached, and what of that goes together."""

from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from impactcell.fieldbus.link import ModuleLink, SerialLine, TlsFiles
from impactcell.settings.fields import InputFile, NotNegative, Positive, Section, host_name, module_host

_LINK: Final = ModuleLink()
"""What the link does by itself; a key that is left out means that."""
_LOWEST_UNIT, _HIGHEST_UNIT = 1, 247
"""Addresses of single devices on a serial line: 0 is a broadcast, the others are reserved (Modbus over Serial
Line V1.02, section 2.2)."""


class TlsSection(Section):
    """Modbus/TCP Security: both sides show certificates."""

    ca_certificate: InputFile
    """Certificates (PEM) that the module's certificate must lead to."""
    certificate: InputFile | None = None
    """Our own certificate (PEM)."""
    key: InputFile | None = None
    """Our own private key (PEM)."""
    server_name: Annotated[str, AfterValidator(host_name)] | None = None
    """Name that the module's certificate must carry; absent: its `host`."""

    @model_validator(mode="after")
    def _key_belongs_to_a_certificate(self) -> Self:
        if self.key is not None and self.certificate is None:
            raise ValueError("`key` is of no use without `certificate`; name both, or leave it out")
        return self


class SerialSection(Section):
    """The serial line that the module is on."""

    device: str
    """Serial port, as in /dev/ttyUSB0 or COM3."""
    baudrate: Annotated[int, Field(ge=300, le=4_000_000)] = 19_200
    """Bits a second."""
    parity: Literal["none", "even", "odd"] = "even"
    """Parity bit; without one, Modbus wants two stop bits."""
    stop_bits: Literal[1, 2] = 1
    """Stop bits of a character."""


class ModuleSection(Section):
    """The measuring module, and how it is reached."""

    transport: Literal["tcp", "tls", "udp", "rtu_over_tcp", "rtu"] = "tcp"
    """What requests travel on: `tcp`, also encrypted, has many in flight, each of the others one."""
    serial: SerialSection | None = None
    """Serial line of transport `rtu`, in the place of host and port."""

    host: Annotated[str, AfterValidator(module_host)] = _LINK.host
    """Address of the module, or of the gateway in front of it."""
    port: Annotated[int, Field(ge=1, le=65535)] = _LINK.port
    """TCP port; 802 is customary with TLS."""
    device_id: Annotated[int, Field(ge=0, le=255)] = _LINK.device_id
    """Modbus unit id; 1 to 247 on a serial line."""
    register_map: InputFile
    """Register map that the module speaks."""
    word_order: Literal["big", "little"] | None = None
    """Order of the words of a value of several registers; absent: as the map says."""
    window: Annotated[int, Field(ge=1, le=64)] | None = None
    """Requests in flight over TCP, without a pause, to a device with an endpoint of its own; absent: found by
    trials, up to 64; 16 or 1 where one fails."""
    max_registers_per_request: Annotated[int, Field(ge=1, le=125)] = _LINK.max_registers
    """Registers asked for at once; some gateways allow fewer than 125."""
    pause_between_requests_ms: NotNegative = _LINK.pause_s * 1e3
    """Rest that a slow device needs between requests."""
    timeout_ms: Positive = _LINK.timeout_s * 1e3
    """An answer later than this closes the connection."""
    tls: TlsSection | None = None
    """Encrypted link; absent: plain Modbus TCP."""

    @property
    def link(self) -> ModuleLink:
        """How the module is reached."""
        tls, serial = self.tls, self.serial
        return ModuleLink(
            host=self.host,
            port=self.port,
            device_id=self.device_id,
            window=self.window,
            max_registers=self.max_registers_per_request,
            pause_s=self.pause_between_requests_ms * 1e-3,
            timeout_s=self.timeout_ms * 1e-3,
            tls=None
            if tls is None
            else TlsFiles(tls.ca_certificate, tls.certificate, tls.key, tls.server_name),
            transport=self.transport,
            serial=None
            if serial is None
            else SerialLine(serial.device, serial.baudrate, serial.parity[0].upper(), serial.stop_bits),
        )

    @model_validator(mode="after")
    def _transport_has_what_it_needs(self) -> Self:
        if self.transport == "rtu" and self.serial is None:
            raise ValueError(
                "`transport: rtu` needs `serial` in the place of `host` and `port`, as in "
                "`serial: {device: /dev/ttyUSB0}`"
            )
        if self.transport != "rtu" and self.serial is not None:
            raise ValueError(
                f"`serial` belongs to `transport: rtu`, this is `transport: {self.transport}`: say "
                "`transport: rtu`, or leave `serial` out"
            )
        if self.transport == "tls" and self.tls is None:
            raise ValueError("`transport: tls` needs `tls` with its certificates")
        if self.tls is not None and self.transport not in ("tcp", "tls"):
            raise ValueError(f"`tls` does not go with `transport: {self.transport}`")
        if self.transport == "rtu" and not _LOWEST_UNIT <= self.device_id <= _HIGHEST_UNIT:
            why = "asks all and is answered by none" if self.device_id == 0 else "is reserved"
            raise ValueError(
                f"`device_id: {self.device_id}` {why} on a serial line; give the module's own, "
                f"{_LOWEST_UNIT} to {_HIGHEST_UNIT}"
            )
        return self

    @model_validator(mode="after")
    def _window_is_kept(self) -> Self:
        if self.window is None or self.window == 1:
            return self
        if self.transport != "tcp":
            raise ValueError(
                f"`window: {self.window}` belongs to `transport: tcp`; `{self.transport}` has one request in "
                "flight: leave it out"
            )
        if self.pause_between_requests_ms:
            raise ValueError(
                f"`window: {self.window}` sends so many requests at once, `pause_between_requests_ms: "
                f"{self.pause_between_requests_ms:g}` lets the module rest after each; leave one of them out"
            )
        return self
