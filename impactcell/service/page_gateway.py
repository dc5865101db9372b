"""What people do on the page, brought from the page's thread to the service's own."""

import asyncio
import json
import logging
from collections.abc import Coroutine, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypeVar

from impactcell.errors import AccessError
from impactcell.opcua.certificates.certificate_files import der, read_certificate, thumbprint
from impactcell.process.background import run_verb
from impactcell.scada import Actor, ConditionAction, RefusedError, Server
from impactcell.scada.audit_log import audited
from impactcell.service.operator_commands import OperatorCommands
from impactcell.settings import CellConfig

T = TypeVar("T")

_log: Final = logging.getLogger(__name__)

ACCEPT_S: Final = 1800.0
"""Longest time for calibrating a model: a law may have to be compiled, at the lowest priority."""


class PageGateway:
    """Implements `web.PageBackend` for cells that OPC UA servers show.

    Parameters
    ----------
    servers : mapping
        The server that shows each cell; logins go to the first one.
    commands : OperatorCommands
        Writes down what people do.
    cells : sequence of CellConfig
    certificates : Path
        Directory of the trust list.

    Made in the service's event loop; the coroutines are awaited in the page's.
    """

    def __init__(
        self,
        servers: Mapping[str, Server],
        commands: OperatorCommands,
        cells: Sequence[CellConfig],
        certificates: Path,
    ) -> None:
        self._servers = servers
        self._commands = commands
        self._cells = {cell.name: cell for cell in cells}
        self._certificates = certificates
        self._loop = asyncio.get_running_loop()

    async def log_in(self, name: str, password: str, address: str) -> Actor:
        """Find out who a password stands for, as the OPC UA server does it."""
        server = next(iter(self._servers.values()))
        return await self._in_service(server.log_in(name, password, address))

    async def act_on_condition(self, cell: str, alarm: str, action: ConditionAction, actor: Actor) -> None:
        """Act on a condition, as its OPC UA methods do it."""
        await self._in_service(self._servers[cell].act_on_condition(cell, alarm, action, actor))

    async def reset_wear(self, cell: str, comment: str, actor: Actor) -> None:
        """Learn the wear level anew, as the OPC UA method does it."""
        await self._in_service(self._servers[cell].reset_wear(cell, comment, actor))

    async def trust_certificate(self, thumbprint: str, actor: Actor) -> None:
        """Let a client connect whose certificate has been refused."""
        await self._in_service(audited(actor, f"trust certificate {thumbprint!r}", self._trust(thumbprint)))

    async def accept_model(self, cell: str, extended: Path, actor: Actor) -> str:
        """Calibrate an extended model for the cell, in a process of its own, and put it into service."""
        work = self._change_model(
            cell, "accept", ["accept", str(self._cells[cell].path), str(extended)], actor
        )
        return await self._in_service(audited(actor, f"{cell}: accept model {extended}", work))

    async def restore_model(self, cell: str, actor: Actor) -> str:
        """Put the model back into service that the last one has replaced."""
        work = self._change_model(cell, "restore", ["restore", str(self._cells[cell].path)], actor)
        return await self._in_service(audited(actor, f"{cell}: restore model", work))

    async def _change_model(self, cell: str, action: str, arguments: list[str], actor: Actor) -> str:
        self._commands.running(cell)  # before: a model that is in service is to be written down
        try:
            outcome = await run_verb(["model", *arguments, "--json"], ACCEPT_S)
        except OSError as error:
            raise RefusedError(
                "BadResourceUnavailable",
                f"{cell}: its model stays, no program can be started on this machine ({error.strerror}); "
                "end others, and try again",
            ) from error
        if not outcome.is_done:
            said = "\n".join(outcome.said) or "it took too long"
            raise RefusedError("BadInvalidState", said)
        model = str(json.loads(outcome.output)["model"])
        try:
            await self._commands.record_model(cell, action, model, actor)
        except Exception:  # noqa: BLE001 - the model is in service, whatever went wrong afterwards
            _log.exception("%s: model %s is in service, but not written down in the journal", cell, model)
        return model

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
