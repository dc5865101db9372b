"""Simulator and service as processes of their own, for tests that look at them from a third."""

import asyncio
import contextlib
import json
import re
import sys
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import yaml

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config"
START_S = 90.0
"""The first start on a machine compiles."""


class AnyProcess(Protocol):
    """What a test needs of a process."""

    @property
    def returncode(self) -> int | None: ...
    def kill(self) -> None: ...
    def terminate(self) -> None: ...
    async def wait(self) -> int | None: ...


@dataclass
class Running:
    """A process with the lines it wrote to standard error."""

    process: AnyProcess
    output: asyncio.StreamReader | None = None
    lines: list[str] = field(default_factory=list)
    news: asyncio.Condition = field(default_factory=asyncio.Condition)

    async def line(self, pattern: str, timeout_s: float = START_S) -> re.Match[str]:
        """Wait for a line of standard error."""

        def found() -> re.Match[str] | None:
            return next((m for text in self.lines if (m := re.search(pattern, text))), None)

        async with asyncio.timeout(timeout_s), self.news:
            await self.news.wait_for(lambda: found() or self.process.returncode is not None)
        match = found()
        assert match, f"no line with {pattern!r} in:\n" + "\n".join(self.lines)
        return match

    async def follow(self, errors: asyncio.StreamReader) -> None:
        """Take what the process writes to standard error, up to its end."""
        async for line in errors:
            async with self.news:
                self.lines.append(line.decode().rstrip())
                self.news.notify_all()
        await self.process.wait()
        async with self.news:
            self.news.notify_all()


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


@contextlib.asynccontextmanager
async def simulator(
    directory: Path, base: str = "prototype", **changes: Any
) -> AsyncIterator[dict[str, Any]]:
    """Serve a scenario with `changes`; gives the addresses it printed, and the `truth` file."""
    scenario = yaml.safe_load((CONFIG / "sim" / f"{base}.yaml").read_text())
    scenario["register_map"] = str(CONFIG / "maps" / "fpga-v1.yaml")
    scenario["listen"]["port"] = 0
    for key, value in changes.items():
        scenario[key] = {**scenario.get(key, {}), **value} if isinstance(value, dict) else value
    path = directory / "scenario.yaml"
    path.write_text(yaml.safe_dump(scenario))
    truth = directory / "truth.jsonl"
    async with started("simulator", "serve", str(path), "--truth", str(truth)) as running:
        assert running.output is not None
        async with asyncio.timeout(START_S):
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
