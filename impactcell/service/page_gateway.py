"""What people do on the page, brought from the page's thread to the service's own."""

import asyncio
from collections.abc import Coroutine, Mapping
from pathlib import Path
from typing import Any, TypeVar

from impactcell.errors import AccessError
from impactcell.opcua.trust_list import der, read_certificate, thumbprint
from impactcell.scada import Actor, ConditionAction, RefusedError, Server
from impactcell.scada.audit_log import audited

T = TypeVar("T")


class PageGateway:
    """Implements `web.PageBackend` for cells that OPC UA servers show.

    Parameters
    ----------
    servers : mapping
        The server that shows each cell; logins go to the first one.
    certificates : Path
        Directory of the trust list.

    Made in the service's event loop; the coroutines are awaited in the page's.
    """

    def __init__(self, servers: Mapping[str, Server], certificates: Path) -> None:
        self._servers = servers
        self._certificates = certificates
        self._loop = asyncio.get_running_loop()

    async def log_in(self, name: str, password: str, address: str) -> Actor:
        """Find out who a password stands for, as the OPC UA server does it."""
        server = next(iter(self._servers.values()))
        return await self._in_service(server.log_in(name, password, address))

    async def act_on_condition(self, cell: str, alarm: str, action: ConditionAction, actor: Actor) -> None:
        """Act on a condition, as its OPC UA methods do it."""
        await self._in_service(self._servers[cell].act_on_condition(cell, alarm, action, actor))

    async def trust_certificate(self, thumbprint: str, actor: Actor) -> None:
        """Let a client connect whose certificate has been refused."""
        await self._in_service(audited(actor, f"trust certificate {thumbprint!r}", self._trust(thumbprint)))

    async def _trust(self, thumbprint: str) -> None:
        if not await asyncio.to_thread(_trust_rejected, self._certificates, thumbprint):
            raise RefusedError("BadNotFound", "no refused certificate has this thumbprint")

    async def _in_service(self, work: Coroutine[Any, Any, T]) -> T:
        return await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(work, self._loop))


def _trust_rejected(pki: Path, wanted: str) -> bool:
    """Move the rejected certificate with this thumbprint to the trusted ones; False where there is none."""
    for path in (pki / "rejected").glob("*"):
        try:
            data = der(read_certificate(path))
        except AccessError:
            continue
        if thumbprint(data) == wanted:
            target = pki / "trusted" / f"{wanted}.der"
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
            path.unlink()
            return True
    return False
