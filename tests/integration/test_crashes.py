"""After `kill -9` the service goes on from the last durable cycle, with the state of an uninterrupted run."""

from pathlib import Path

import pytest

from tests.integration.crashes import crash

pytestmark = pytest.mark.slow


async def test_ten_kills(tmp_path: Path) -> None:
    outcome = await crash(tmp_path, kills=10, seed=20261121, period_s=0.2)
    assert outcome.cycles == sorted(set(outcome.cycles))
    assert outcome.lost == 0
    assert outcome.same_state
    assert len(outcome.cycles) > 10
