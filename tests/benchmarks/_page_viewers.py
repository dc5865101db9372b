"""Process: viewers of a running service's page; `ENDPOINT USER PASSWORD CELL ...`, until it is stopped.

Says how many streams it reads once each has brought a card. It stands back behind the client that is timed on
the same core: in a plant viewers have computers of their own.
"""

import asyncio
import json
import os
import sys

from tests.benchmarks.page import IN_DEPTH, VIEWERS, Viewer

STANDS_BACK = 10
"""Niceness: a tenth of the core where the others want all of it."""


async def main(endpoint: str, user: str, password: str, *cells: str) -> None:
    """Read all streams until one ends, which is a failure."""
    os.nice(STANDS_BACK)
    viewers = [Viewer(user, password) for _ in range(VIEWERS)]
    paths = [f"/live?cell={cells[i % len(cells)]}" if i < IN_DEPTH else "/live" for i in range(VIEWERS)]
    async with asyncio.TaskGroup() as group:
        for viewer, path in zip(viewers, paths, strict=True):
            group.create_task(viewer.run(endpoint, path))
        while not all(viewer.cards for viewer in viewers):
            await asyncio.sleep(0.05)
        print(json.dumps(len(viewers)), flush=True)


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
