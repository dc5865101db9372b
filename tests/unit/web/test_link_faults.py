"""Why a module does not answer is said in German, in its alarm and on the page, as a transport said it."""

import asyncio
import json
import re

from impactcell.alarms.rules import module_connection
from impactcell.errors import LinkError
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.transports.pipelined_tcp import PipelinedTcp
from impactcell.german.link_faults import german_link_fault
from impactcell.records import ModuleStatus
from impactcell.web.cell_view import CellView
from impactcell.web.interface import CellNews

ENGLISH = re.compile(r"\b(no|not|connection|answer|device|nothing|within|lost|closed|holding)\b")


async def why(port: int) -> str:
    """Ask once for two registers; say why nothing came."""
    client = ModbusClient(PipelinedTcp(ModuleLink("127.0.0.1", port, timeout_s=0.2)))
    try:
        await client.connect()
        await client.read(100, 2)
    except LinkError as error:
        return str(error)
    finally:
        await client.close()
    raise AssertionError("it answered")


async def listening(hears: object) -> tuple[asyncio.Server, int]:
    server = await asyncio.start_server(hears, "127.0.0.1", 0)  # type: ignore[arg-type]
    return server, server.sockets[0].getsockname()[1]


async def test_what_a_transport_says_has_its_german() -> None:
    async def stay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read()
        writer.close()

    async def leave(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1)
        writer.transport.abort()

    said = []
    for hears in (stay, leave):
        server, port = await listening(hears)
        async with server:
            said.append(await why(port))
    said.append(await why(port))
    german = [german_link_fault(f"press-1: {reason}") for reason in said]
    assert not [text for text in german if ENGLISH.search(text)], said
    unanswered = "Gerät 1: keine Antwort auf die Anfrage nach 2 Registern ab 100 innerhalb von 0,2 s"
    assert german[0].endswith(unanswered)
    assert german[0].startswith("press-1: 127.0.0.1:")


def test_what_is_not_known_stays_as_it_is() -> None:
    assert german_link_fault("press-1: a datagram of 3 bytes") == "press-1: a datagram of 3 bytes"


def test_the_alarm_and_the_card_say_it() -> None:
    reason = "press-1: 10.0.0.9:502 device 1: no connection within 0.5 s"
    result = module_connection.result(reason, connected=False)
    assert "Gerät 1: keine Verbindung innerhalb von 0,5 s. Stromversorgung" in result.message.german
    view = CellView("press-1")
    view.take(CellNews("press-1", status=ModuleStatus(connected=False, reason=reason)))
    said = json.loads(view.encode("card"))["link_reason"]
    assert said == {"en": reason, "de": german_link_fault(reason)}
