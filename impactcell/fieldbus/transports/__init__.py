"""Transports: what carries requests to a device. All keep the promises of `protocol.Transport`.

Modbus TCP, plain or encrypted, to a device of its own has the pipelined client; everything else goes through
pymodbus, one request at a time: TLS, UDP, RTU over TCP, serial lines, and an endpoint with several devices.
"""

from collections import Counter
from collections.abc import Iterable
from functools import partial

from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.transports.checked_pymodbus import CheckedPymodbus
from impactcell.fieldbus.transports.pipelined_tcp import PipelinedTcp
from impactcell.fieldbus.transports.protocol import Transport
from impactcell.fieldbus.transports.shared_line import SharedLine

__all__ = ["Transport", "Transports", "transport_for"]


class Transports:
    """The transports of one process: links that lead to one endpoint share its connection.

    Parameters
    ----------
    links : iterable of ModuleLink
        All that there are; those of one endpoint differ in nothing but `device_id`, and in what concerns the
        device alone (`max_registers`, `pause_s`).
    """

    def __init__(self, links: Iterable[ModuleLink]) -> None:
        self._devices = Counter(link.endpoint for link in links)
        self._lines: dict[tuple[str, int], SharedLine] = {}

    def transport_for(self, link: ModuleLink) -> Transport:
        """Make the transport that a link asks for; it is not connected yet."""
        if link.transport == "tcp" and self._devices[link.endpoint] <= 1:
            return PipelinedTcp(link)
        line = self._lines.get(link.endpoint)
        if line is None:
            line = self._lines[link.endpoint] = SharedLine(partial(CheckedPymodbus, link))
        return line.transport(link)


def transport_for(link: ModuleLink) -> Transport:
    """Make the transport of a device that shares its endpoint with none; it is not connected yet."""
    return Transports((link,)).transport_for(link)
