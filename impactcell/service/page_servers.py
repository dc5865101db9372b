"""The pages that show a service's cells: one for each `web.endpoint`, each in a thread of its own."""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Mapping, Sequence
from dataclasses import replace

from impactcell.errors import SettingsError
from impactcell.scada import Server
from impactcell.service.factory import cell_facts, page_settings
from impactcell.service.operator_commands import OperatorCommands
from impactcell.service.page_gateway import PageGateway
from impactcell.settings import CellConfig
from impactcell.web import PageServer, TourStop

log = logging.getLogger(__name__)


@contextlib.asynccontextmanager
async def served_pages(
    cells: Sequence[CellConfig],
    shown_by: Mapping[str, Server],
    commands: OperatorCommands,
    tours: Mapping[str, Sequence[TourStop]],
) -> AsyncIterator[dict[str, PageServer]]:
    """Serve the pages until the context ends; yields the page of each cell that has one.

    Parameters
    ----------
    cells : sequence of CellConfig
    shown_by : mapping
        The OPC UA server that shows each cell.
    commands : OperatorCommands
    tours : mapping
        What the page tells of each cell that is a demo.

    Raises
    ------
    SettingsError
        A page that was asked for cannot be served.
    """
    pages: dict[str, PageServer] = {}
    async with contextlib.AsyncExitStack() as stack:
        for section in dict.fromkeys(cell.settings.web for cell in cells):
            if section is None:
                continue
            on_page = [cell for cell in cells if cell.settings.web == section]
            servers = {cell.name: shown_by[cell.name] for cell in on_page}
            settings = page_settings(on_page[0], section)
            facts = [
                replace(cell_facts(cell, servers[cell.name].endpoint), tour=tours.get(cell.name, ()))
                for cell in on_page
            ]
            page = PageServer(settings, facts, PageGateway(servers, commands, on_page, settings.certificates))
            try:
                await asyncio.to_thread(page.start)
            except SettingsError as error:
                if "web" in on_page[0].settings.model_fields_set:
                    key = "web.endpoint" if isinstance(error.__cause__, OSError) else "web.certificate"
                    raise SettingsError(on_page[0].fault(str(error), key)) from error
                # Nobody asked for the page at this address: another service of this machine may have it.
                log.warning("%s; no page for now", error)
                continue
            stack.push_async_callback(asyncio.to_thread, page.stop)
            if section.is_in_the_clear:
                log.warning(
                    "page: http beyond loopback is allowed (web.allow_without_encryption): anybody can listen"
                )
            behind = f", behind a proxy at {section.public_url}" if section.public_url else ""
            log.info("page at %s%s", page.endpoint, behind)
            pages |= dict.fromkeys(servers, page)
        yield pages
