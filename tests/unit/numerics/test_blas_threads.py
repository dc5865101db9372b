"""Tests run with as many threads of BLAS as the product: two that wait for each other cost a lot."""

import os
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from impactcell.api import findings
from impactcell.campaign import Campaign, Excitation
from impactcell.errors import CampaignError


def test_numpy_was_imported_after_the_package_had_said_how_many() -> None:
    np.ones((2, 2)) @ np.ones((2, 2))
    threads = _threads()
    assert threads
    assert set(threads) == {int(os.environ["OPENBLAS_NUM_THREADS"])}


def test_the_workflow_has_as_many_though_numpy_was_there_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a notebook that begins with `import numpy`; what others have is theirs again afterwards."""
    seen = []

    def investigate(*_args: Any, **_options: Any) -> None:
        seen.extend(_threads())
        raise CampaignError("enough")

    monkeypatch.setattr(findings, "investigate", investigate)
    with threadpool_limits(2, "blas"):
        others = _threads()
        with pytest.raises(CampaignError, match="enough"):
            findings.discrepancy(Campaign(Excitation.TAP, ()))
        assert _threads() == others
    assert set(seen) == {int(os.environ["OPENBLAS_NUM_THREADS"])}


def _threads() -> list[int]:
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]
