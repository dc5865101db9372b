"""The documented map of the FPGA module, parsed once."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from impactcell.fieldbus.registers import RegisterMap

MAP = Path(__file__).resolve().parents[3] / "config" / "maps" / "fpga-v1.yaml"


@pytest.fixture(scope="session")
def declaration() -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load(MAP.read_text(encoding="utf-8"))
    return content


@pytest.fixture(scope="session")
def fpga(declaration: dict[str, Any]) -> RegisterMap:
    return RegisterMap.from_mapping(declaration)
