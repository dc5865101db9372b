"""A cell on a module without a waveform, and on one with one buffer, in processes of their own."""

import asyncio
import contextlib
import re
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from asyncua import Client, ua

from impactcell.scada import Role
from impactcell.scada.users import User, with_password, write_users
from tests.integration.forked import forked
from tests.integration.processes import CONFIG, simulator, truths, write_cell
from tests.integration.test_probe import probed
from tests.integration.test_running_cell import engineer, node
from tests.patience import COMPILING_S

pytestmark = pytest.mark.slow

CYCLES = 8
LOGGER = {
    "force": {"rate_hz": 50_000, "noise_std": 0.4, "longest_s": 0.16},
    "position": {"rate_hz": 50_000, "noise_std": 1.5e-6, "longest_s": 0.16},
}
"""What a logger with one rate records."""


def stored(directory: Path) -> list[dict[str, Any]]:
    """Cycles that the service has stored."""
    with contextlib.closing(
        sqlite3.connect(f"file:{directory / 'press-1.sqlite'}?mode=ro", uri=True)
    ) as rows:
        rows.row_factory = sqlite3.Row
        return [dict(row) for row in rows.execute("SELECT * FROM cycles ORDER BY seq")]


async def status_of(client: Client, path: str) -> ua.StatusCode:
    value = await (await node(client, "press-1", path)).read_data_value(raise_on_bad_status=False)
    assert value.StatusCode is not None
    return value.StatusCode


@pytest.mark.parametrize("kind", ["summary", "one-buffer"])
async def test_a_cell_runs_on_a_module_that_has_less(kind: str, tmp_path: Path) -> None:
    register_map = str(CONFIG / "maps" / f"{kind}.yaml")
    write_users(tmp_path / "users.yaml", {"eve": with_password(User("eve", Role.ENGINEER), "integration")})
    scenario: dict[str, Any] = {
        "register_map": register_map, "strikes": {"period_s": 0.5},
        "batches": [{"from_cycle": 1, "id": "A"}], "deviations": [],
    }  # fmt: skip
    if kind == "one-buffer":
        scenario["sensors"] = LOGGER
        scenario["strikes"]["ahead"] = 1  # who reads late would find the next cycle in the only buffer
    async with simulator(tmp_path, **scenario) as told:
        # `probe` asks once: a busy machine answers later than a module does
        module = {"register_map": register_map, "timeout_ms": 10_000}
        cell = write_cell(tmp_path, told["port"], module=module)
        async with forked("impactcell", "run", str(cell)) as service:
            endpoint = (await service.line(r"cell=press-1 at (\S+)"))[1]
            async with asyncio.timeout(COMPILING_S):
                while len(stored(tmp_path)) < CYCLES:
                    await asyncio.sleep(0.1)
            async with engineer(endpoint, "integration") as client:
                spe = await status_of(client, "Signature/Spe")
                mu_s = await status_of(client, "Friction/StaticFriction")
                mu_k = await status_of(client, "Friction/KineticFriction")
            code, out, err = await probed(cell)
    assert (code, err) == (0, "")
    truth, rows = truths(told["truth"]), stored(tmp_path)
    cycles = [row["cycle"] for row in rows]
    assert cycles == sorted(set(cycles))
    for row in rows:
        assert 0.0 < row["mu_s_std"] < 0.02
        assert abs(row["mu_s"] - truth[row["cycle"]]["mu_s"]) < 4.0 * row["mu_s_std"]
    assert not [line for line in service.lines if "no register `" in line]
    if kind == "summary":
        assert {row["estimator"] for row in rows} == {"combined"}
        assert {row["mu_k_reason"] for row in rows} == {"through mu_k/mu_s of the model"}
        assert spe.is_bad()
        assert (mu_s.is_good(), mu_k.is_good(), mu_k.is_bad()) == (True, False, False)
        assert any("there is no waveform" in line for line in service.lines)
        assert "force       no samples; the module says " in out
    else:
        assert {row["estimator"] for row in rows} == {"waveform"}
        assert re.search(r"status      (not )?ready, session ", out)  # between two taps, or during one
        assert "one buffer" in out
