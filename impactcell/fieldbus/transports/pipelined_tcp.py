"""Modbus TCP with many requests in flight, over one connection after another; plain or encrypted."""

import asyncio
import contextlib
from collections.abc import Sequence

from impactcell.errors import LinkError
from impactcell.fieldbus.link import NO_NAME, ModuleLink
from impactcell.fieldbus.request_batching import RequestBatch
from impactcell.fieldbus.transports.request_window import RequestWindow
from impactcell.fieldbus.transports.tcp_connection import TcpConnection
from impactcell.fieldbus.transports.transaction_ids import TransactionIds


class PipelinedTcp:
    """A `Transport` with up to `window.size` requests in flight.

    Every attempt has a fresh transaction id, also across connections.
    """

    def __init__(self, link: ModuleLink) -> None:
        self.link = link
        if link.window is None and link.pause_s:
            self.window = RequestWindow(1, "for the pause between requests")
        else:
            self.window = RequestWindow(link.window)
        self._connection: TcpConnection | None = None
        self._transaction_ids = TransactionIds()

    @property
    def connected(self) -> bool:
        """Whether requests can be sent."""
        return self._connection is not None and self._connection.open

    @property
    def round_trip_s(self) -> float:
        """Time between the last request and its reply; nan before the first."""
        return self._connection.round_trip_s if self._connection is not None else float("nan")

    async def connect(self) -> None:
        """Open the connection, unless it is open.

        Raises
        ------
        LinkError
            If it cannot be made within the timeout.
        """
        if self.connected:
            return
        link, loop = self.link, asyncio.get_running_loop()
        self.window.begin_connection()
        context = link.tls.context() if link.tls else None
        name = (link.tls.server_name or link.host) if link.tls else None
        try:
            async with asyncio.timeout(link.timeout_s):
                _, self._connection = await loop.create_connection(
                    lambda: TcpConnection(link, self._transaction_ids, self.window),
                    link.host,
                    link.port,
                    ssl=context,
                    server_hostname=name,
                )
        except TimeoutError:
            raise LinkError(f"{link}: no connection within {link.patience}") from None
        except ConnectionRefusedError as error:
            raise LinkError(f"{link}: no connection: nothing listens at this host and port") from error
        except OSError as error:
            raise LinkError(f"{link}: no connection: {error.strerror or error}") from error
        except UnicodeError as error:
            raise LinkError(f"{link}: no connection: {NO_NAME}") from error

    async def close(self) -> None:
        """Close the connection and wait until it is gone; all that is pending fails."""
        connection, self._connection = self._connection, None
        if connection is None:
            return
        connection.fail(LinkError(f"{self.link}: connection closed"))
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self.link.timeout_s):
                await connection.lost.wait()

    def submit(self, batches: Sequence[RequestBatch], *, first: bool = False) -> None:
        """Send `batches` as the window allows; `first`: before all that waits.

        Raises
        ------
        LinkError
            If there is no connection.
        """
        if self._connection is None:
            raise LinkError(f"{self.link}: not connected")
        self._connection.submit(batches, first=first)
