"""Hosts compared by what they are, however they are written; nobody is asked for a name."""

import socket
from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import Final

_LOOPBACK: Final = "127.0.0.1"
"""What `localhost` is, and `::1` beside it (RFC 6761, 6.3)."""


def host_identity(host: str) -> str:
    """Give every spelling of one address, and every name of the loopback, the same form; others their own.

    >>> [host_identity(host) for host in ("LocalHost.", "::1", "127.1", "0x7f.0.0.1", "::ffff:127.0.0.1")]
    ['127.0.0.1', '127.0.0.1', '127.0.0.1', '127.0.0.1', '127.0.0.1']
    >>> [host_identity(host) for host in ("FE80::0:1%eth0", "127.0.0.2", "Press-1.plant", "10.1")]
    ['fe80::1%eth0', '127.0.0.2', 'press-1.plant', '10.0.0.1']
    """
    name = host.lower().removesuffix(".")
    if name == "localhost" or name.endswith(".localhost"):
        return _LOOPBACK
    address = _address(name)
    if isinstance(address, IPv6Address):
        address = IPv4Address(_LOOPBACK) if address.is_loopback else address.ipv4_mapped or address
    return name if address is None else str(address)


def _address(name: str) -> IPv4Address | IPv6Address | None:
    """Read a number as the system does that connects: short, octal and hexadecimal ones, too."""
    try:
        return ip_address(name)
    except ValueError:
        pass
    try:
        return IPv4Address(socket.inet_aton(name))
    except (OSError, UnicodeError, ValueError):
        return None
