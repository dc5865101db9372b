"""A whole cell, and `impactcell probe`, over each transport, in processes of their own."""

import asyncio
import contextlib
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from tests.certificates import Authority
from tests.integration.forked import forked
from tests.integration.processes import simulator, truths, write_cell
from tests.integration.test_probe import probed
from tests.patience import COMPILING_S

pytestmark = pytest.mark.slow

DECIMATED = {
    "force": {"rate_hz": 20_000, "noise_std": 0.4, "longest_s": 0.02},
    "position": {"rate_hz": 2_000, "noise_std": 1.5e-6, "longest_s": 0.2},
}
"""As many samples as a line carries in a quarter of a second."""


def stored(directory: Path) -> dict[int, float]:
    """What the service has stored of mu_s, by cycle."""
    with contextlib.closing(
        sqlite3.connect(f"file:{directory / 'press-1.sqlite'}?mode=ro", uri=True)
    ) as rows:
        return dict(rows.execute("SELECT cycle, mu_s FROM cycles"))


def reached(kind: str, told: dict[str, Any], authority: Authority | None) -> dict[str, Any]:
    """The section `module` of a cell that reaches the simulator."""
    if kind == "rtu":
        line = {"device": told["serial"], "baudrate": 115_200, "parity": "none", "stop_bits": 2}
        return {"transport": kind, "window": None, "port": 502, "serial": line}
    if authority is None:
        return {"transport": kind, "window": None}
    certificate, key = authority.issue("service")
    files = {"ca_certificate": str(authority.file), "certificate": str(certificate), "key": str(key)}
    return {"transport": kind, "window": None, "tls": {**files, "server_name": "module.test"}}


@pytest.mark.parametrize("kind", ["tls", "udp", "rtu_over_tcp", "rtu"])
async def test_a_probe_over_each_transport(kind: str, tmp_path: Path) -> None:
    listen: dict[str, Any] = {"transport": kind}
    authority = Authority(tmp_path, "plant") if kind == "tls" else None
    if authority is not None:
        certificate, key = authority.issue("module")
        listen |= {
            "certificate": str(certificate), "key": str(key), "client_authority": str(authority.file)
        }  # fmt: skip
    strikes = {"period_s": 0.1, "cycles": 1}
    async with simulator(tmp_path, listen=listen, strikes=strikes, sensors=DECIMATED) as told:
        cell = write_cell(tmp_path, told["port"], module=reached(kind, told, authority))
        for _ in range(100):
            code, out, err = await probed(cell)
            if "tap         cycle 1" in out:
                break
    assert (code, err) == (0, "")
    assert "identity    module_name IMPACT-FPGA, serial_number SIM-0001" in out
    assert "force       " in out
    assert "position    " in out


async def test_a_cell_runs_on_a_serial_line_of_115200_baud(tmp_path: Path) -> None:
    listen = {"transport": "rtu", "baudrate": 115_200}
    strikes = {"period_s": 1.0, "cycles": 4}
    async with simulator(
        tmp_path, listen=listen, strikes=strikes, sensors=DECIMATED, batches=[{"from_cycle": 1, "id": "A"}]
    ) as told:
        cell = write_cell(tmp_path, 502, module=reached("rtu", told, None))
        async with forked("impactcell", "run", str(cell)) as service:
            await service.line(r"cell=press-1 at (\S+)")
            async with asyncio.timeout(COMPILING_S):
                while len(truths(told["truth"])) < 4 or len(stored(tmp_path)) < 4:
                    await asyncio.sleep(0.1)
    assert not [line for line in service.lines if "lost" in line]
    truth = truths(told["truth"])
    results = stored(tmp_path)
    assert sorted(results) == [1, 2, 3, 4]
    for cycle, mu_s in results.items():  # the end of contact is known to half a sample of position only
        assert mu_s == pytest.approx(truth[cycle]["mu_s"], rel=0.05)
