"""Every service with odd values in its fields: answered with a status of the standard; the server goes on."""

import logging

import pytest
from asyncua import Client, ua
from asyncua.ua.ua_binary import struct_from_binary

from tests.opcua_requests import OddRequests
from tests.opcua_server import CELL, site
from tests.opcua_wire import alive
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.slow

REQUESTS = 700
"""A fault in one place of one service is met by one in thousands: longer runs try more of them."""
OURS = {"BadInternalError", "BadUnexpectedError", "BadEncodingError", "BadDecodingError"}
"""Codes by which a server says that the fault is its own, or that a message is none."""


@pytest.mark.parametrize(("user", "seed"), [("observer", 1), ("operator", 2), ("engineer", 3)])
async def test_odd_requests(user: str, seed: int, caplog: pytest.LogCaptureFixture) -> None:
    async with site() as here, await here.client(user) as client:
        for _ in range(5):
            here.publish()
        here.raise_alarm()
        cell = await here.node(client, "")
        nodes = await _nodes_below(client, cell.nodeid)
        methods = [
            (ua.NodeId(node.Identifier.rpartition("/")[0], node.NamespaceIndex), node)
            for node in nodes
            if await client.get_node(node).read_node_class() is ua.NodeClass.Method
        ]
        assert len(methods) > len(("StartBatch", "ResetWear", "SetTarget", "AbortPositioning"))
        odd = OddRequests(seed, [*nodes, ua.NodeId(ua.ObjectIds.Server)], methods)
        seen = set()
        for number in range(REQUESTS):
            request = odd.request()
            code = await _answer(client, odd, request)
            assert code not in OURS, (code, request)
            seen.add((type(request).__name__, code))
            if number % 50 == 0:
                here.publish()
        assert len({name for name, code in seen if code == "Good"}) > 15, "hardly anything was understood"
        await alive(here)
    faults = [record for record in caplog.records if record.levelno >= logging.ERROR]
    assert [record.getMessage() for record in faults] == []


async def _nodes_below(client: Client, root: ua.NodeId) -> list[ua.NodeId]:
    found = [root]
    for node in found:
        if node.Identifier.count("/") < 2:
            found += [child.nodeid for child in await client.get_node(node).get_children()]
    assert any(node.Identifier == f"{CELL}/WearLimit/Acknowledge" for node in found)
    return list(dict.fromkeys(found))


async def _answer(client: Client, odd: OddRequests, request: object) -> str:
    """Send a request; the name of the status it is answered with, the worst of its results first."""
    try:
        data = await client.uaclient.protocol.send_request(request, timeout=PATIENCE_S)
    except ua.UaStatusCodeError as error:
        return str(ua.StatusCode(error.code).name)
    answer = struct_from_binary(getattr(ua, type(request).__name__.replace("Request", "Response")), data)
    odd.answered(answer)
    results = getattr(answer, "Results", None) or getattr(
        getattr(answer, "Parameters", None), "Results", None
    )
    for result in results or ():
        code = result if isinstance(result, ua.StatusCode) else getattr(result, "StatusCode", None)
        if isinstance(code, ua.StatusCode) and code.name in OURS:
            return str(code.name)
    return str(answer.ResponseHeader.ServiceResult.name)
