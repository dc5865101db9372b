"""Transports: what carries requests to a device. All keep the promises of `protocol.Transport`."""

from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.transports.pipelined_tcp import PipelinedTcp
from impactcell.fieldbus.transports.protocol import Transport

__all__ = ["Transport", "transport_for"]


def transport_for(link: ModuleLink) -> Transport:
    """Make the transport that a link asks for; it is not connected yet."""
    return PipelinedTcp(link)
