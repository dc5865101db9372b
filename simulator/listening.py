"""The server that a scenario asks for."""

import ssl
from collections.abc import Callable

from simulator.answers import RegisterDevice
from simulator.faults import FaultInjector
from simulator.modbus_server import ModbusServer
from simulator.rtu_over_tcp import RtuOverTcpServer
from simulator.scenario import Listen
from simulator.serial_line import SerialServer, pace_of
from simulator.udp_server import UdpServer


def server_of(
    listen: Listen, device: RegisterDevice, faults: FaultInjector, before: Callable[[], None]
) -> ModbusServer:
    """Make the server that `listen` describes; it does not listen yet.

    Raises
    ------
    OSError
        A certificate cannot be read.
    """
    unit, host, port = listen.device_id, listen.host, listen.port
    match listen.transport:
        case "rtu":
            return SerialServer(device, unit, faults=faults, before=before, pace=pace_of(listen.baudrate))
        case "udp":
            return UdpServer(device, unit, host=host, port=port, faults=faults, before=before)
        case "rtu_over_tcp":
            return RtuOverTcpServer(device, unit, host=host, port=port, faults=faults, before=before)
        case _:
            tls = _tls(listen) if listen.transport == "tls" else None
            return ModbusServer(device, unit, host=host, port=port, faults=faults, before=before, tls=tls)


def _tls(listen: Listen) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.load_cert_chain(str(listen.certificate), listen.key)
    if listen.client_authority is not None:
        context.load_verify_locations(listen.client_authority)
        context.verify_mode = ssl.CERT_REQUIRED
    return context
