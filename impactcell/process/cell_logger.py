"""Log lines that say of which cell they are: `cell=... cycle=... message`, to be read and searched."""

import logging
from collections.abc import MutableMapping
from typing import Any


class CellLogger(logging.LoggerAdapter[logging.Logger]):
    """Names the cell in every line, and the cycle where `cycle=n` is given beside the message."""

    def __init__(self, logger: logging.Logger, cell: str) -> None:
        super().__init__(logger, {"cell": cell})
        self.cell = cell

    def process(self, message: Any, kwargs: MutableMapping[str, Any]) -> tuple[str, MutableMapping[str, Any]]:
        """Put cell and cycle before the message."""
        cycle = kwargs.pop("cycle", None)
        where = f"cell={self.cell}" if cycle is None else f"cell={self.cell} cycle={cycle}"
        return f"{where} {message}", kwargs
