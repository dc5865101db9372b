"""Whole cells over each of pymodbus's transports under faults: nothing wrong, twice or untold.

As `chaos`, in virtual time, with the faults of the module, its memory and its server; the relay that changes
frames knows Modbus TCP alone. A run is a line of a file, and is not done twice.
"""

import asyncio
import json
import logging
from collections import Counter
from typing import Final

from simulator.faults import FaultKind
from tests.benchmarks._chaos_faults import KINDS
from tests.benchmarks._chaos_links import over
from tests.benchmarks._fieldbus_faults import RESULTS
from tests.benchmarks.chaos import cell
from tests.benchmarks.table import Table
from tests.virtual_time import run_virtually

TRANSPORTS: Final = ("tls", "udp", "rtu_over_tcp", "rtu")
"""Those that pymodbus carries."""
FAULTS_A_RUN: Final = 50
"""Faulty exchanges of a cell in a run."""
CELLS: Final = 10
"""At a time."""
GRACE_S: Final = 0.002
"""Real time that bytes may take through the system before the clock is turned on, s."""


async def _together(kind: str, first: int) -> list[dict[str, int]]:
    return await asyncio.gather(*(cell(first + i, FAULTS_A_RUN, over(kind)) for i in range(CELLS)))


def study(kind: str, wanted: int) -> tuple[Counter[str], int]:
    """Run until so many faulty exchanges are on file; sums over all runs of a transport, and their number."""
    file = RESULTS / f"chaos-{kind}.jsonl"
    file.parent.mkdir(exist_ok=True)
    runs = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    while sum(run["faults"] for run in runs) < wanted:
        fresh = run_virtually(_together(kind, len(runs)), GRACE_S)
        with file.open("a") as out:
            out.writelines(json.dumps(run) + "\n" for run in fresh)
        runs += fresh
    total = Counter[str]()
    for run in runs:
        total.update(run)
    return total, len(runs)


def _row(kind: str, seen: Counter[str], runs: int) -> list[str]:
    kinds = sum(1 for each in KINDS if seen[f"fault {each}"])
    counts = ("wrong", "twice", "untold", "falsely_missed", "stuck")
    made = f"{seen['made']} / {seen['right']}"
    told = f"{seen['missed']} / {seen['unreadable']} / {seen['restarts']}"
    return [
        kind,
        f"{seen['faults']} of {kinds} ({runs} runs)",
        made,
        *(str(seen[key]) for key in counts),
        told,
    ]


def tables(*, quick: bool = False) -> list[Table]:
    """What came through, transport by transport."""
    logging.disable(logging.CRITICAL)
    try:
        seen = {kind: study(kind, 1000 if quick else 5000) for kind in TRANSPORTS}
    finally:
        logging.disable(logging.NOTSET)
    rarest = min(seen[kind][0][f"fault {each}"] for kind in TRANSPORTS for each in FaultKind)
    return [
        Table(
            "Whole cells over pymodbus under faults",
            [
                "transport", "faulty exchanges of kinds (bar 1000)", "cycles made / right", "wrong (bar 0)",
                "twice (0)", "untold (0)", "told as lost and not lost (0)", "stuck (0)",
                "told: overwritten / unreadable / restarts",
            ],
            [_row(kind, *seen[kind]) for kind in TRANSPORTS],
            f"Virtual time, {CELLS} cells at a time, shipped map (all checksums). Each fault of a reply "
            f"happened {rarest} times at least on each transport. 0 of n says less than 3 / n at 95 %.",
        )
    ]  # fmt: skip
