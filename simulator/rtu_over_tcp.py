"""A simulated gateway that passes RTU frames on over TCP."""

from simulator.modbus_server import ModbusServer
from simulator.rtu import RtuConnection


class RtuOverTcpServer(ModbusServer):
    """Serves devices in RTU frames over TCP."""

    connection = RtuConnection
