"""`kill -9` at 200 random moments, ten a run; a run is a line of a file, and is not done twice."""

import asyncio
import json
import sys
import tempfile
from pathlib import Path

from tests.benchmarks.table import Table
from tests.integration.crashes import crash
from tests.integration.processes import ROOT

RUNS, KILLS = 20, 10
RESULTS = ROOT / "bench-results" / "crashes.jsonl"


def study(runs: int) -> list[dict[str, int | bool]]:
    """Do the runs that are not in the file yet; all of them."""
    RESULTS.parent.mkdir(exist_ok=True)
    done = [json.loads(line) for line in RESULTS.read_text().splitlines()] if RESULTS.exists() else []
    for seed in range(runs):
        if any(entry["seed"] == seed for entry in done):
            continue
        with tempfile.TemporaryDirectory() as directory:
            outcome = asyncio.run(crash(Path(directory), KILLS, seed))
        entry = {
            "seed": seed,
            "kills": KILLS,
            "cycles": len(outcome.cycles),
            "lost": outcome.lost,
            "overwritten": outcome.overwritten,
            "twice": len(outcome.cycles) - len(set(outcome.cycles)),
            "same_state": outcome.same_state,
        }
        done.append(entry)
        with RESULTS.open("a") as out:
            out.write(json.dumps(entry) + "\n")
        print(f"crashes: {entry}", file=sys.stderr, flush=True)
    return done


def tables(quick: bool = False) -> list[Table]:
    """What the journal held after the kills."""
    done = study(1 if quick else RUNS)
    kills = sum(int(entry["kills"]) for entry in done)
    rows = [
        (
            f"cycles lost, of {sum(int(e['cycles']) for e in done)}",
            "0",
            str(sum(int(e["lost"]) for e in done)),
            f"{sum(int(e['overwritten']) for e in done)} more overwritten in the module, each of them told",
        ),
        ("cycles twice", "0", str(sum(int(e["twice"]) for e in done)), ""),
        (
            "states identical to an uninterrupted run, to the bit",
            "all",
            f"{sum(bool(e['same_state']) for e in done)} of {len(done)} runs",
            "",
        ),
    ]
    return [Table(f"kill -9 at {kills} random moments", ("what", "bar", "measured", "interval"), rows)]
