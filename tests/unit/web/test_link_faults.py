"""Why a module does not answer is said in German, in its alarm and on the page, as a transport said it."""

import asyncio
import json
import re
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from impactcell import fieldbus
from impactcell.alarms.rules import module_connection
from impactcell.errors import FieldbusError, LinkError
from impactcell.fieldbus.codec import (
    EXCEPTION_NAMES,
    FunctionCode,
    check_reply,
    mask_write_request,
    read_request,
    read_write_request,
    write_request,
)
from impactcell.fieldbus.device_identification import identification_request
from impactcell.fieldbus.link import NO_NAME, ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.transports.pipelined_tcp import PipelinedTcp
from impactcell.fieldbus.transports.reply_watch import MbapWatch, RtuWatch
from impactcell.german.link_faults import german_link_fault
from impactcell.records import ModuleStatus
from impactcell.web.cell_view import CellView
from impactcell.web.interface import CellNews

ENGLISH = re.compile(
    r"\b(no|not|connection|answer|device(?!_id)|nothing|within|lost|closed|holding|refused|from|the|illegal|bytes|reply)\b"
)


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
    unanswered = (
        "Gerät 1: keine Antwort auf die Anfrage nach 2 Registern ab 100 innerhalb von 200 ms (timeout_ms)"
    )
    assert german[0].endswith(unanswered)
    assert german[0].startswith("press-1: 127.0.0.1:")


READ, WRITE = read_request(FunctionCode.READ_HOLDING, 100, 2), write_request(40, np.array([1, 2], np.uint16))
REQUESTS = (
    READ,
    WRITE,
    read_request(FunctionCode.READ_COILS, 7, 3),
    read_request(FunctionCode.READ_DISCRETE, 7, 3),
    read_request(FunctionCode.READ_INPUT, 7, 3),
    *(read_request(function, 7, 1) for function in (FunctionCode.READ_COILS, FunctionCode.READ_DISCRETE)),
    read_request(FunctionCode.READ_HOLDING, 7, 1),
    write_request(7, np.array([1], np.uint16)),
    write_request(7, np.array([1], np.uint16), "coil"),
    read_write_request(100, 1, 40, np.array([1], np.uint16)),
    mask_write_request(7, 1, 2),
    write_request(7, np.array([1, 0], np.uint16), "coil"),
    read_write_request(100, 2, 40, np.array([1], np.uint16)),
    identification_request(),
)


def odd_answers() -> Iterator[Callable[[], object]]:
    """What a module may answer that is no good answer."""
    for code in (*EXCEPTION_NAMES, 99):
        yield lambda code=code: check_reply(READ, bytes([READ.pdu[0] | 0x80, code]))
    for request in REQUESTS:
        yield lambda request=request: check_reply(request, bytes([request.pdu[0] | 0x80, 2]))
        yield lambda request=request: RtuWatch(1, request).take(bytes([9, 3, 4]))
    yield lambda: check_reply(READ, b"\x06\x00")
    yield lambda: check_reply(READ, READ.pdu[:1] + b"\x04\x00")
    yield lambda: check_reply(READ, READ.pdu[:1] + b"\x05\x00\x00\x00\x00")
    yield lambda: check_reply(identification_request(), b"\x2b\x0e\x01\x01\x00")
    for header in ((1, 0, 9, 1), (2, 0, 7, 1), (1, 5, 7, 1), (1, 0, 7, 3), (1, 0, 3, 1)):
        frame = struct.pack(">HHHB", *header) + bytes(6)
        yield lambda frame=frame: MbapWatch(1, 1, READ, datagram=True).take(frame)
    yield lambda: MbapWatch(1, 1, READ, datagram=True).take(b"abc")
    yield lambda: RtuWatch(1, READ).take(bytes([1, 3, 4, 0, 0, 0, 0, 0, 0]))
    yield lambda: RtuWatch(1, READ).take(bytes([1, 3, 4, 0, 0, 0, 0, 0, 0, 0]))
    yield lambda: RtuWatch(1, READ).take(bytes([1, 4, 4]))


def test_answers_that_do_not_fit_have_their_german() -> None:
    said = []
    for answer in odd_answers():
        with pytest.raises(FieldbusError) as error:
            answer()
        said.append(f"press-1: 10.0.0.9:502 device 1: {error.value}")
    assert len({*said}) > 30
    for reason in said:
        german = german_link_fault(reason)
        assert german.startswith("press-1: 10.0.0.9:502 Gerät 1: "), german
        assert not ENGLISH.search(german), german


@pytest.mark.parametrize(
    ("reason", "german"),
    [
        ("no connection: No route to host", "keine Verbindung: kein Weg dorthin"),
        (
            f"no connection: {NO_NAME}",
            "keine Verbindung: ein Rechnername hat zwischen seinen Punkten je 1 bis 63 Zeichen",
        ),
        ("HTTP answers there, not Modbus TCP", "dort antwortet HTTP, nicht Modbus TCP"),
        (
            "connection lost: [Errno 104] Connection reset by peer",
            "Verbindung verloren: die Gegenseite hat die Verbindung abgebrochen",
        ),
        (
            (
                "2 holding registers from 100 refused: illegal data address (exception 2); this "
                "is not a module of map "
                "fpga-v1, or device_id 1 is wrong"
            ),
            (
                "die Anfrage nach 2 Registern ab 100 wird abgelehnt: diese Adresse gibt es dort "
                "nicht (Ausnahme 2); das "
                "ist kein Modul der Karte fpga-v1, oder device_id 1 ist falsch"
            ),
        ),
        (
            "3 readings of the status block do not fit its CRC",
            "3 Lesungen des Statusblocks passen nicht zu seiner Prüfsumme",
        ),
        (
            (
                "cycle_counter shows 65536 and ring_cycle [65536]; velocity shows 3e-40 m/s: the "
                "word order is wrong, "
                "with `word_order: little` all of it can be"
            ),
            (
                "cycle_counter zeigt 65536 und ring_cycle [65536]; velocity zeigt 3e-40 m/s: die "
                "Wortreihenfolge ist "
                "falsch, mit `word_order: little` ist alles möglich"
            ),
        ),
        (
            "125 registers from 0 change faster than they can be read",
            "125 Register ab 0 ändern sich schneller, als sie gelesen werden können",
        ),
        (
            "the connection was lost while several requests were in flight",
            "die Verbindung ging verloren, während mehrere Anfragen unterwegs waren",
        ),
        (
            "TLS files ca.pem cannot be used: [Errno 2] No such file or directory",
            "die TLS-Dateien ca.pem sind nicht verwendbar: gibt es nicht",
        ),
    ],
)
def test_what_happens_rarely_is_said_in_german(reason: str, german: str) -> None:
    assert german_link_fault(f"press-1: {reason}") == f"press-1: {german}"


def test_every_fault_of_a_link_in_the_program_has_its_german() -> None:
    """Whatever is raised of a link stands here with something in place of what is put in."""
    room = Path(fieldbus.__file__).parent
    raised = re.compile(
        r"(?:LinkError|ProtocolError|WrongDeviceError)\(\s*(f?\"[^)]*?)\s*[,)]\s*(?:from|$)", re.MULTILINE
    )
    texts = [text for path in room.rglob("*.py") for text in raised.findall(path.read_text())]
    assert len(texts) > 20
    for text in texts:
        words = "".join(re.findall(r'f?"((?:[^"\\]|\\.)*)"', text))
        words = words.replace("{self._request.description}", READ.description)
        words = words.replace("{request.description}", READ.description)
        words = words.replace("{error};", f"{READ.description} refused: illegal function (exception 1);")
        words = re.sub(r"\{oldest\.batch.*?\} \{timeout\}", f"{READ.description} within {{patience}}", words)
        words = re.sub(r"\{[\w.]*patience\}", "9 ms (timeout_ms)", words)
        words = re.sub(r"\{[^{}]*(?:link|_cell)[^{}]*\}: ", "", words)
        words = re.sub(r"\{(?:\{\}|[^{}])*(?:\{[^{}]*\}[^{}]*)*\}", "7", words)
        assert german_link_fault(words) != words or words in ("7", "7: 7"), words


def test_what_is_not_known_stays_as_it_is() -> None:
    assert german_link_fault("press-1: a datagram of 3 bytes") == "press-1: a datagram of 3 bytes"


def test_the_alarm_and_the_card_say_it() -> None:
    reason = "press-1: 10.0.0.9:502 device 1: no connection within 2.5 ms (timeout_ms)"
    result = module_connection.result(reason, connected=False)
    assert (
        "Gerät 1: keine Verbindung innerhalb von 2,5 ms (timeout_ms). Stromversorgung"
        in result.message.german
    )
    view = CellView("press-1")
    view.take(CellNews("press-1", status=ModuleStatus(connected=False, reason=reason)))
    said = json.loads(view.encode("card"))["link_reason"]
    assert said == {"en": reason, "de": german_link_fault(reason)}
