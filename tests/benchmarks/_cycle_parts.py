"""Processor time of one cycle in the service by part, Modbus left out."""

import asyncio
import contextlib
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from impactcell.cell import pipeline
from impactcell.journal import store
from impactcell.records import Capture, Channel, ModuleStatus, PositioningState, Summary, uniform_times
from impactcell.scada import Server
from impactcell.service.cell_task import CellTask
from impactcell.service.factory import cell_description, server_settings
from impactcell.service.history_source import JournalHistory
from impactcell.service.operator_commands import OperatorCommands
from impactcell.service.worker import CellWorker
from impactcell.settings import read_cell
from impactcell.tracking import wear_batch
from impactcell.tracking.signature import tracker
from tests.benchmarks._modules import FORCE_HZ, POSITION_HZ, taps
from tests.benchmarks.table import Table

LEARNING = 90
"""Cycles before those that count: compilation, and what is learned at first."""
WEAR, SIGNATURE, STATE = "tracking: wear and batch", "tracking: signature", "state as bytes"
THREAD, VALUES, LINK = "thread of the cell", "OPC UA: values and conditions", "OPC UA: state of the link"
PARTS: tuple[tuple[str, Any, str], ...] = (
    ("features of the capture", pipeline, "extract"),
    ("friction by every predictor", pipeline, "estimate_from_features"),
    (WEAR, wear_batch, "update"),
    (SIGNATURE, tracker, "update"),
    (STATE, CellWorker, "_blob"),
    ("capture as bytes", store, "encode_capture"),
    ("journal, capture as bytes included", store.Journal, "append"),
    (THREAD, CellWorker, "_process"),
    (VALUES, Server, "publish"),
    (LINK, Server, "module"),
)
ELSEWHERE = np.zeros(4_000_000)
"""Gone through before each cycle: in the service, others' work leaves nothing of it in the caches either."""


def captures() -> list[Capture]:
    """Taps of the simulator's plant as the register map of the benchmark's modules gives them."""
    recorded = []
    for samples, header in taps():
        channels = {}
        for name, rate_hz, step in (("force", FORCE_HZ, 0.025), ("position", POSITION_HZ, 1e-9)):
            codes = np.rint(samples[name] / step).astype(np.int64)
            times = uniform_times(0.0, rate_hz, len(codes))
            channels[name] = Channel(times, codes * step, resolution=step)
        recorded.append(
            Capture(
                0,
                float(header["velocity"]),
                float(header["mass"]),
                **channels,
                stroke_m=float(header["stroke"]),
                batch_id=str(header["batch_id"]),
                summary=Summary(float(header["peak_force"]), float(header["sliding_distance"])),
            )
        )
    return recorded


@contextlib.contextmanager
def timed(spent: dict[str, float]) -> Iterator[None]:
    """Add up the processor time of each part in this thread, s."""

    def watch(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def watched(*arguments: Any, **named: Any) -> Any:
            began = time.thread_time()
            try:
                return function(*arguments, **named)
            finally:
                spent[part] += time.thread_time() - began

        return watched

    with contextlib.ExitStack() as stack:
        for part, owner, name in PARTS:
            stack.enter_context(patch.object(owner, name, watch(part, getattr(owner, name))))
        yield


async def cycles(file: Path, number: int) -> list[dict[str, float]]:
    """Spent time by part of each cycle after learning."""
    cell = read_cell(file)
    running = CellTask(cell)
    recorded, rows = captures(), []
    history, actions = JournalHistory({cell.name: running}), OperatorCommands({cell.name: running})
    users = cell.settings.opcua.users_file
    async with Server(server_settings(cell), users, [cell_description(cell)], history, actions) as server:
        for cycle in range(1, LEARNING + number + 1):
            np.add(ELSEWHERE, 1.0, out=ELSEWHERE)
            capture = replace(
                recorded[cycle % len(recorded)], cycle=cycle, time_ns=time.time_ns() + cycle * 500_000_000
            )
            spent: dict[str, float] = defaultdict(float)
            with timed(spent):
                step_result = await running.worker.process(capture, PositioningState(), None)
                server.publish(cell.name, step_result.snapshot)
                for alarm in running.worker.alarms:
                    server.alarm(cell.name, alarm)
                server.module(
                    cell.name,
                    ModuleStatus(connected=True, received=cycle, round_trip_s=1e-3),
                    capture.time_ns,
                )
            rows.append(spent)
        await running.close()
    return rows[LEARNING:]


def parts(file: Path, number: int) -> Table:
    """Table of what one cycle costs in the cell of `file`."""
    rows = asyncio.run(cycles(file, number))
    spent = {part: 1e3 * np.array([row[part] for row in rows]) for part, _, _ in PARTS}
    spent["all of these"] = spent[THREAD] + spent[VALUES] + spent[LINK]
    spent["all but tracking and its state"] = (
        spent["all of these"] - spent[WEAR] - spent[SIGNATURE] - spent[STATE]
    )
    return Table(
        "One cycle by part",
        ("what", "CPU, median", "mean"),
        [(part, f"{np.median(times):.2f} ms", f"{np.mean(times):.2f} ms") for part, times in spent.items()],
        f"{number} cycles of 20 000 force and 4 000 position samples in one thread, Modbus left out; the "
        "caches are emptied before each.",
    )
