"""node-opcua, a client that shares no code with ours or with asyncua, against the server.

Run `npm ci` in tests/interop/node to have these; skipped where Node.js or its packages are absent, never
with IMPACTCELL_CI=1.
"""

import asyncio
import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization

from impactcell.alarms import NAMES, AlarmEvent, EventKind, Message
from impactcell.opcua.certificates.certificate_files import fingerprint
from impactcell.opcua.certificates.making import make_certificate, own_hosts, write_pair
from impactcell.records import Alarm
from impactcell.scada import HistoryValue, Role
from impactcell.scada.users import User, read_users, write_users
from tests.interop.wire import Wire
from tests.opcua_server import CELL, PASSWORDS, START_NS, Site, site
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent / "node"
MODEL = Path(__file__).resolve().parents[2] / "impactcell" / "scada" / "model"
OUTAGE_S = 5.0

ROWS = (
    "browse",
    "read",
    "subscribe",
    "policy Basic256Sha256",
    "policy Aes128_Sha256_RsaOaep",
    "policy Aes256_Sha256_RsaPss",
    "discovery without security",
    "session without security",
    "wrong password",
    "anonymous",
    "user certificate",
    "untrusted certificate, trusted without a restart",
    "events with OfType(ConditionType)",
    "ConditionRefresh",
    "ConditionRefresh of an unknown subscription",
    "Acknowledge by helper",
    "Acknowledge by method",
    "Confirm",
    "AddComment",
    "shelving",
    "Enable and Disable",
    "wrong EventId",
    "observer may not acknowledge",
    "methods of the cell",
    "history raw with continuation",
    "history aggregates with continuation",
    "history of alarms",
    "recovery after an orderly close",
    "recovery after a TCP reset",
    "recovery after a 5 s outage",
    "recovery after a 5 s outage without a reset",
)


@pytest.fixture(scope="module")
def node() -> str:
    """Path of Node.js, with the packages in place."""
    program = shutil.which("node")
    missing = None if program else "Node.js is not installed"
    if missing is None and not (HERE / "node_modules" / "node-opcua").is_dir():
        missing = "its packages are absent: npm ci in tests/interop/node"
    if missing is not None:
        if os.environ.get("IMPACTCELL_CI") == "1":
            pytest.fail(missing)
        pytest.skip(missing)
    assert program is not None
    return program


def _pem(path: Path) -> str:
    certificate = x509.load_der_x509_certificate(path.read_bytes())
    pem = path.with_suffix(".crt.pem")
    pem.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    return str(pem)


class Commands:
    """What a row can ask for."""

    def __init__(self, here: Site, wire: Wire) -> None:
        self.here = here
        self.wire = wire

    async def __call__(self, command: str, details: dict) -> dict:
        return await getattr(self, "do_" + command.replace(" ", "_"))(**details) or {}

    async def do_publish(self, mu: float) -> None:
        self.here.publish(mu)

    async def do_lost(self) -> None:
        self.here.server.mark_bad(CELL, time.time_ns())

    async def do_normal(self) -> None:
        self.here.actions.alarms.clear()
        self.here.server.alarm(CELL, Alarm("WearLimit", time_ns=time.time_ns()))

    async def do_raise(self) -> None:
        self.here.raise_alarm()

    async def do_clear(self) -> None:
        self.here.clear_alarm()

    async def do_rejected(self) -> dict:
        return {"count": len(list((self.here.directory / "pki" / "rejected").iterdir()))}

    async def do_trust(self) -> None:
        for path in (self.here.directory / "pki" / "rejected").iterdir():
            path.rename(self.here.directory / "pki" / "trusted" / path.name)

    async def do_history(self, count: int) -> dict:
        values = [HistoryValue(START_NS + i * 10**9, float(i)) for i in range(count)]
        self.here.history.stored[CELL, "Friction/StaticFriction"] = values
        return {"start": START_NS // 10**6, "end": START_NS // 10**6 + count * 1000}

    async def do_alarm_history(self) -> dict:
        actions = self.here.actions
        actions.alarms.clear()
        told = [
            actions.apply(
                CELL,
                name,
                AlarmEvent(event, number, START_NS + number * 10**9, message=Message("past", "vorbei")),
            )
            for number, (name, event) in enumerate(
                [
                    ("WearLimit", EventKind.ACTIVATE),
                    ("WearLimit", EventKind.CLEAR),
                    ("BatchShift", EventKind.ACTIVATE),
                ]
            )
        ]
        self.here.history.transitions[CELL] = told
        return {"start": START_NS // 10**6, "end": START_NS // 10**6 + 10_000}

    async def do_close(self) -> None:
        self.wire.close()

    async def do_reset(self) -> None:
        self.wire.reset()

    async def do_cut(self) -> None:
        self.wire.cut()
        self._mended = asyncio.get_running_loop().time() + OUTAGE_S

    async def do_stall(self) -> None:
        self.wire.stall()
        self._mended = asyncio.get_running_loop().time() + OUTAGE_S

    async def do_mend(self) -> None:
        # The outage lasts as long as its name says: there is nothing to wait for but time.
        await asyncio.sleep(max(0.0, self._mended - asyncio.get_running_loop().time()))
        self.wire.mend()


async def _run(node: str) -> dict[str, dict]:
    results: dict[str, dict] = {}
    async with site() as here, Wire(int(here.server.endpoint.split(":")[2].split("/")[0])) as wire:
        commands = Commands(here, wire)
        person, person_key = make_certificate("person", "urn:test:person", own_hosts())
        person_files = write_pair(here.directory / "person", person, person_key)
        listed = read_users(here.directory / "users.yaml")
        print_ = fingerprint(person_files[0].read_bytes())
        listed["person"] = User("person", Role.OBSERVER, certificate=print_)
        write_users(here.directory / "users.yaml", listed)
        stranger = here.untrusted()
        process = await asyncio.create_subprocess_exec(
            node,
            str(HERE / "client.js"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            limit=2**20,
            env={
                **os.environ,
                "SITE": json.dumps(
                    {
                        "directory": str(here.directory),
                        "endpoint": here.server.endpoint,
                        "wire": f"opc.tcp://127.0.0.1:{wire.port}/impactcell",
                        "cell": CELL,
                        "passwords": PASSWORDS,
                        "client": {"certificate": _pem(here.certificate), "key": str(here.key)},
                        "stranger": {"certificate": _pem(stranger[0]), "key": str(stranger[1])},
                        "person": {"certificateDer": str(person_files[0]), "key": str(person_files[1])},
                    }
                ),
            },
        )
        assert process.stdout is not None
        assert process.stdin is not None
        try:
            while line := await process.stdout.readline():
                if not line.startswith(b"@@"):
                    continue
                said = json.loads(line[2:])
                if "ask" in said:
                    answer = await commands(said.pop("ask"), said)
                    process.stdin.write(json.dumps(answer).encode() + b"\n")
                elif "row" in said:
                    results[said["row"]] = said
                elif "done" in said:
                    break
        finally:
            if process.returncode is None:
                process.kill()
            await process.wait()
    return results


@pytest.mark.interop
def test_every_row(node: str, subtests: pytest.Subtests) -> None:
    """One client goes through all rows: they are one test, lest two workers run it twice."""
    results = asyncio.run(asyncio.wait_for(_run(node), PATIENCE_S))
    assert set(results) == set(ROWS)
    for row in ROWS:
        with subtests.test(row):
            assert results[row]["ok"], results[row]["detail"]


@pytest.mark.interop
@pytest.mark.parametrize("companions", ["of the OPC Foundation", "shipped"])
def test_nodesets_load_without_a_warning(node: str, companions: str) -> None:
    shipped = ["Di.Subset", "Machinery.Subset"] if companions == "shipped" else []
    files = [str(MODEL / f"{name}.NodeSet2.xml") for name in ["ImpactCell", *shipped]]
    done = subprocess.run(
        [node, str(HERE / "nodesets.js"), *files], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""
    # It also says what it thinks of the version of Node.js; that is not about our files.
    lines = [line for line in done.stdout.splitlines() if "verify_pcks1" not in line]
    assert len(lines) == 1, "node-opcua had something to say: " + done.stdout
    said = json.loads(lines[0][2:])
    assert said["methods"] == ["StartBatch", "ResetWear", "SetTarget", "AbortPositioning"]
    assert said["alarms"] == list(NAMES)
    assert said["identification"]
    assert (said["unit"], said["high"]) == (4404786, 1)
