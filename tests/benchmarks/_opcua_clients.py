"""Process: OPC UA clients that measure how long after a write its notification arrives.

The answers are cut with `struct` instead of decoded: a Python client that decodes everything would measure
itself.
"""

import asyncio
import json
import struct
import sys
import time

from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256

from impactcell.quantities import CYCLE
from tests.opcua_server import CELL, CLIENT_URI

# All figures that change with each cycle, and one of the link: 30.
ITEMS = [q.path for q in CYCLE if q.path not in ("Batch/BatchId", "Model/Name")] + ["Module/RoundTripTime"]
IN_FLIGHT = 3
EPOCH_DIFFERENCE_S = 11_644_473_600


def cut(body: bytes) -> tuple[int, int, float]:
    """Read out of a PublishResponse: sequence number, number of values, server time of the first.

    The header takes 28 bytes; 0 values where it is no data change.
    """
    at = 28 + 4
    available = struct.unpack_from("<i", body, at)[0]
    at += 4 + 4 * max(available, 0) + 1
    sequence, _, notifications = struct.unpack_from("<Iqi", body, at)
    at += 16
    if notifications < 1 or struct.unpack_from("<H", body, at + 2)[0] != 811:
        return sequence, 0, 0.0
    at += 9
    count = struct.unpack_from("<i", body, at)[0]
    mask, kind = struct.unpack_from("<BB", body, at + 8)
    at += 10
    if kind & 0x80:
        at += 4 + 8 * struct.unpack_from("<i", body, at)[0]
    else:
        at += {11: 8, 7: 4, 1: 1}[kind]
    at += 4 if mask & 2 else 0
    at += 8 if mask & 4 else 0
    assert mask & 8, "no server timestamp"
    ticks = struct.unpack_from("<q", body, at)[0]
    return sequence, count, ticks / 1e7 - EPOCH_DIFFERENCE_S


class Listener:
    """One client with one subscription."""

    def __init__(self, client: Client, paths: list[str], interval_ms: float) -> None:
        self.client, self.paths, self.interval_ms = client, paths, interval_ms
        self.delays: list[float] = []
        self.values = 0
        self._acknowledge: list[ua.SubscriptionAcknowledgement] = []

    async def start(self) -> None:
        client = self.client
        index = await client.get_namespace_index("urn:impactcell:cells")
        parameters = ua.CreateSubscriptionParameters()
        parameters.RequestedPublishingInterval = self.interval_ms
        parameters.RequestedLifetimeCount, parameters.RequestedMaxKeepAliveCount = 60, 20
        parameters.PublishingEnabled = True
        request = ua.CreateSubscriptionRequest()
        request.Parameters = parameters
        data = await client.uaclient.protocol.send_request(request)
        made = ua.ua_binary.struct_from_binary(ua.CreateSubscriptionResponse, data)
        self.number = made.Parameters.SubscriptionId
        wanted = ua.CreateMonitoredItemsParameters()
        wanted.SubscriptionId, wanted.TimestampsToReturn = self.number, ua.TimestampsToReturn.Both
        for handle, path in enumerate(self.paths):
            item = ua.MonitoredItemCreateRequest()
            item.ItemToMonitor.NodeId = ua.NodeId(f"{CELL}/{path}", index)
            item.ItemToMonitor.AttributeId = ua.AttributeIds.Value
            item.MonitoringMode = ua.MonitoringMode.Reporting
            item.RequestedParameters.ClientHandle, item.RequestedParameters.QueueSize = handle, 10
            wanted.ItemsToCreate.append(item)
        results = await client.uaclient.create_monitored_items(wanted)
        assert all(result.StatusCode.is_good() for result in results)

    async def listen(self, until: float) -> None:
        await asyncio.gather(*(self._one(until) for _ in range(IN_FLIGHT)))

    async def _one(self, until: float) -> None:
        while time.time() < until:
            request = ua.PublishRequest()
            request.Parameters.SubscriptionAcknowledgements, self._acknowledge = self._acknowledge, []
            data = await self.client.uaclient.protocol.send_request(request, timeout=30)
            arrived = time.time()
            sequence, count, written = cut(bytes(data))
            if count:
                self.delays += [arrived - written] * count
                self.values += count
                acknowledge = ua.SubscriptionAcknowledgement()
                acknowledge.SubscriptionId, acknowledge.SequenceNumber = self.number, sequence
                self._acknowledge.append(acknowledge)


async def connected(site: dict[str, str]) -> Client:
    # Looked after once a second, it gives up where a busy machine is late for that.
    client = Client(site["endpoint"], timeout=30, watchdog_intervall=30.0)
    client.session_timeout = 10_000
    client.application_uri = CLIENT_URI
    client.set_user(site.get("user", "observer"))
    client.set_password(site["password"])
    if "certificate" in site:
        await client.set_security(
            SecurityPolicyBasic256Sha256,
            site["certificate"],
            site["key"],
            mode=ua.MessageSecurityMode.SignAndEncrypt,
        )
    await client.connect()
    return client


async def timer(interval_s: float, until: float) -> list[float]:
    """Measure how late a bare timer is on this machine now: nothing can be told sooner than that."""
    late = []
    while time.time() < until:
        begin = time.monotonic()
        await asyncio.sleep(interval_s)
        late.append(time.monotonic() - begin - interval_s)
    return late


async def main(site: dict[str, str], clients: int, items: int, interval_ms: float, seconds: float) -> None:
    paths = ITEMS[:items]
    listeners = [Listener(await connected(site), paths, interval_ms) for _ in range(clients)]
    for listener in listeners:
        await listener.start()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.readline)
    begin = time.time()
    await asyncio.gather(*(listener.listen(begin + 2.0) for listener in listeners))
    for listener in listeners:
        # The first seconds carry the start of all the others.
        listener.delays.clear()
        listener.values = 0
    measured = time.time()
    until = measured + seconds
    late, *_ = await asyncio.gather(
        timer(interval_ms / 1e3, until), *(listener.listen(until) for listener in listeners)
    )
    spent = time.time() - measured
    delays = [delay for listener in listeners for delay in listener.delays]
    values = sum(listener.values for listener in listeners)
    sys.stdout.write(json.dumps({"delays": delays, "values": values, "seconds": spent, "late": late}) + "\n")
    sys.stdout.flush()
    for listener in listeners:
        await listener.client.disconnect()


if __name__ == "__main__":
    given = json.loads(sys.argv[1])
    asyncio.run(main(given["site"], given["clients"], given["items"], given["interval_ms"], given["seconds"]))
