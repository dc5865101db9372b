"""The workflow on a dask cluster of two worker processes gives the same result to the byte."""

from pathlib import Path

import pytest

from impactcell import campaign as campaigns
from impactcell.cli.discrepancy import discrepancy
from impactcell.errors import DiscrepancyError
from tests.discrepancy.test_workflow import make


@pytest.mark.filterwarnings("default")
def test_two_worker_processes_change_nothing(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    campaigns.write(make("viscous_friction", shots=24), tmp_path / "campaign")
    discrepancy(tmp_path / "campaign", tmp_path / "here")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        discrepancy(tmp_path / "campaign", tmp_path / "there", scheduler=cluster.scheduler_address)
    here, there = ((tmp_path / name / "result.json").read_bytes() for name in ("here", "there"))
    assert here == there


@pytest.mark.filterwarnings("default")
def test_no_scheduler_is_said(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    campaigns.write(make(shots=12), tmp_path / "campaign")
    with pytest.raises(DiscrepancyError, match="no dask scheduler"):
        discrepancy(tmp_path / "campaign", tmp_path / "out", scheduler="tcp://127.0.0.1:1")
