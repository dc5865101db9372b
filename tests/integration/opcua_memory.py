"""Process: an OPC UA server that tells how much memory it has, whenever it is asked."""

import asyncio
import gc
import json
import sys
import tracemalloc

import psutil

from impactcell.scada import ServerLimits
from tests.opcua_server import site


async def main() -> None:
    """Serve until stdin ends."""
    loop, process = asyncio.get_running_loop(), psutil.Process()
    limits = ServerLimits(hello_s=3600.0, activation_s=3600.0)
    async with site(limits=limits, allow_none=True) as here:
        gc.freeze()  # the address space is no garbage: looking through it takes most of each answer's time
        tracemalloc.start()  # not before: making the address space would take minutes
        port = int(here.server.endpoint.split(":")[2].split("/")[0])
        sys.stdout.write(json.dumps({"port": port}) + "\n")
        sys.stdout.flush()
        while await loop.run_in_executor(None, sys.stdin.readline):
            gc.collect()
            host = here.server._host
            assert host is not None
            state = {
                "traced": tracemalloc.get_traced_memory()[0],
                "rss": process.memory_info().rss,
                "connections": len(host._connections),
            }
            sys.stdout.write(json.dumps(state) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    asyncio.run(main())
