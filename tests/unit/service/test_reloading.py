"""What a running cell says of files that changed under it."""

import logging
import shutil
from pathlib import Path

import pytest

from impactcell.process.cell_logger import CellLogger
from impactcell.service.reloading import reloaded_cell
from impactcell.settings import read_cell

CONFIG = Path("config")


def test_a_register_map_whose_content_changed_is_told_and_not_taken_over(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    layout = tmp_path / "layout.yaml"
    shutil.copy(CONFIG / "maps" / "fpga-v1.yaml", layout)
    path = tmp_path / "cell.yaml"
    text = (CONFIG / "cells" / "prototype.yaml").read_text(encoding="utf-8")
    text = text.replace("../maps/fpga-v1.yaml", str(layout.resolve()))
    path.write_text(text.replace("../models/", f"{(CONFIG / 'models').resolve()}/"), encoding="utf-8")
    running = read_cell(path)
    log = CellLogger(logging.getLogger("impactcell.test"), "press-1")

    assert reloaded_cell(running, log).register_map == running.register_map
    assert not caplog.messages, "nothing has changed"
    changed = layout.read_text(encoding="utf-8").replace("name: ", "name: other-", 1)
    layout.write_text(changed, encoding="utf-8")
    assert reloaded_cell(running, log).register_map == running.register_map
    (told,) = caplog.messages
    assert "taken over only by a restart" in told
    assert str(layout) in told
