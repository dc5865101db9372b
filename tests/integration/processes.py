"""Simulator and service as processes of their own, for tests that look at them from a third."""

import asyncio
import contextlib
import json
import sys
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import yaml

from impactcell.process import yaml_loader
from tests.integration.forked import forked
from tests.integration.running import Running
from tests.patience import COMPILING_S

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config"


@contextlib.asynccontextmanager
async def started(*arguments: str) -> AsyncIterator[Running]:
    """Run a Python module as a process; it is ended by SIGTERM afterwards."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", *arguments, stdout=PIPE, stderr=PIPE, cwd=ROOT
    )
    assert process.stderr is not None
    running = Running(process, process.stdout)
    reader = asyncio.create_task(running.follow(process.stderr))
    try:
        yield running
    finally:
        if process.returncode is None:
            process.terminate()
        await process.wait()
        await reader


def scenario_content(base: str, changes: dict[str, Any]) -> dict[str, Any]:
    """Read a scenario of the simulator, and change it."""
    content: dict[str, Any] = yaml_loader.load(CONFIG / "sim" / f"{base}.yaml")[0]
    content["register_map"] = str(CONFIG / "maps" / "fpga-v1.yaml")
    content["listen"]["port"] = 0
    for key, value in changes.items():
        content[key] = {**content.get(key, {}), **value} if isinstance(value, dict) else value
    return content


@contextlib.asynccontextmanager
async def simulator(
    directory: Path, base: str = "prototype", **changes: Any
) -> AsyncIterator[dict[str, Any]]:
    """Serve a scenario with `changes`; gives the addresses it printed, and the `truth` file."""
    path = directory / "scenario.yaml"
    path.write_text(yaml.safe_dump(scenario_content(base, changes)))
    truth = directory / "truth.jsonl"
    async with forked("simulator", "serve", str(path), "--truth", str(truth)) as running:
        assert running.output is not None
        async with asyncio.timeout(COMPILING_S):
            line = await running.output.readline()
        assert line, "\n".join(running.lines)
        yield {**json.loads(line), "truth": truth, "running": running}


def write_cell(directory: Path, port: int, name: str = "press-1", **changes: Any) -> Path:
    """Write a cell file for a simulated module at `port`, with an endpoint at a free port."""
    cell: dict[str, Any] = {
        "format": 1,
        "cell": name,
        "module": {"port": port, "register_map": str(CONFIG / "maps" / "fpga-v1.yaml"), "window": 16},
        "model": str(CONFIG / "models" / "prototype.yaml"),
        "part": {"mass_kg": 18.9},
        "actuator": {"stroke_mm": 1.5},
        "alarms": {"wear_limit": 0.25},
        "opcua": {"endpoint": "opc.tcp://127.0.0.1:0/", "allow_sessions_without_encryption": True},
        "journal": {"file": f"{name}.sqlite"},
        "web": None,
    }
    for key, value in changes.items():
        cell[key] = {**(cell.get(key) or {}), **value} if isinstance(value, dict) else value
    path = directory / f"{name}.yaml"
    path.write_text(yaml.safe_dump(cell))
    return path


def truths(path: Path) -> dict[int, dict[str, Any]]:
    """What really happened, by cycle."""
    return {entry["cycle"]: entry for entry in told(path) if "cycle" in entry}


def told(path: Path) -> list[dict[str, Any]]:
    """All that the simulator wrote of what really happened; a line that is being written is left out."""
    return [json.loads(line) for line in path.read_text().splitlines(keepends=True) if line.endswith("\n")]
