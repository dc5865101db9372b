"""Log lines as `time level cell=... cycle=... message`, so that they can be read and searched."""

import logging
import time
from collections.abc import MutableMapping
from typing import Any


class CellLogger(logging.LoggerAdapter[logging.Logger]):
    """Names the cell in every line, and the cycle where `extra={"cycle": n}` is given."""

    def __init__(self, cell: str) -> None:
        super().__init__(logging.getLogger("impactcell.service"), {"cell": cell})
        self.cell = cell

    def process(self, message: Any, kwargs: MutableMapping[str, Any]) -> tuple[str, MutableMapping[str, Any]]:
        """Put cell and cycle before the message."""
        cycle = kwargs.pop("cycle", None)
        where = f"cell={self.cell}" if cycle is None else f"cell={self.cell} cycle={cycle}"
        return f"{where} {message}", kwargs


def configure() -> None:
    """Write log lines to standard error, each with UTC time and level."""
    handler = logging.StreamHandler()
    formatter = logging.Formatter("%(asctime)s.%(msecs)03dZ %(levelname)s %(message)s", "%Y-%m-%dT%H:%M:%S")
    formatter.converter = time.gmtime
    handler.setFormatter(formatter)
    root = logging.getLogger()
    root.handlers[:] = [handler]
