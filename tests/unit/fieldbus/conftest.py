"""The documented map of the FPGA module, parsed once, and a clock that does not wait."""

import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from impactcell.fieldbus.registers import RegisterMap
from tests.virtual_time import HastyLoop

MAP = Path(__file__).resolve().parents[3] / "config" / "maps" / "fpga-v1.yaml"


def pytest_asyncio_loop_factories() -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Run the tests of this folder with a clock that is turned on while nobody has anything to do."""
    return {"hasty": HastyLoop}


@pytest.fixture(scope="session")
def declaration() -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load(MAP.read_text(encoding="utf-8"))
    return content


@pytest.fixture(scope="session")
def fpga(declaration: dict[str, Any]) -> RegisterMap:
    return RegisterMap.from_mapping(declaration)
