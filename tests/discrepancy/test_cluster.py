"""The workflow on a dask cluster of two worker processes gives the same result to the byte."""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from impactcell import campaign as campaigns
from impactcell.cli.discrepancy import discrepancy
from impactcell.errors import DiscrepancyError
from impactcell.physics import Ensemble, TapInput
from impactcell.physics.effects import withdraw_effect
from impactcell.physics.outside_effects import offer_effects
from tests.discrepancy.study import write_blank_report
from tests.discrepancy.test_workflow import make
from tests.patience import PATIENCE_S
from tests.unit.physics.test_outside_effects import OWN


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Nobody is given up who is only slow."""
    dask = pytest.importorskip("dask")
    monkeypatch.setattr("impactcell.cli.cluster.ANSWER_S", PATIENCE_S)
    timeouts = {f"distributed.comm.timeouts.{kind}": f"{PATIENCE_S} s" for kind in ("connect", "tcp")}
    with dask.config.set({**timeouts, "distributed.scheduler.worker-ttl": None}):
        yield


@pytest.mark.long
@pytest.mark.filterwarnings("default")
def test_two_worker_processes_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr("impactcell.api.findings.write_reports", write_blank_report)
    campaigns.write(make("viscous_friction", shots=18), tmp_path / "campaign")
    discrepancy(tmp_path / "campaign", tmp_path / "here")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        discrepancy(tmp_path / "campaign", tmp_path / "there", scheduler=cluster.scheduler_address)
    here, there = ((tmp_path / name / "result.json").read_bytes() for name in ("here", "there"))
    assert here == there


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_workers_know_an_effect_of_the_users_own(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    from impactcell.cli.cluster import cluster_mapper

    file = tmp_path / "own_pull.py"
    file.write_text(OWN, encoding="utf-8")
    offer_effects([file])
    try:
        time_s = np.linspace(0.0, 0.05, 20)
        slide = Ensemble(
            [TapInput(1.0, 18.9)], ["own_pull"],
            position_time_s=[time_s], initial_speed_m_s=np.array([0.1]),
        )  # fmt: skip
        plants = [np.array([6.5e5, 465.0, 0.2, 0.152, pull_n]) for pull_n in (0.0, 5.0)]
        with (
            distributed.LocalCluster(
                n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None
            ) as cluster,
            cluster_mapper(cluster.scheduler_address) as mapper,
        ):
            for pull_n, position_m in zip((0.0, 5.0), mapper(slide.samples, plants), strict=True):
                braking = 0.152 * 9.81 - pull_n / 18.9
                parabola = 0.1 * time_s - 0.5 * braking * time_s**2
                np.testing.assert_allclose(position_m, parabola, rtol=1e-9, atol=1e-12)
    finally:
        withdraw_effect("own_pull")


@pytest.mark.filterwarnings("default")
def test_no_scheduler_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("impactcell.cli.cluster.ANSWER_S", 0.5)
    campaigns.write(make(shots=12), tmp_path / "campaign")
    with pytest.raises(DiscrepancyError, match="no dask scheduler"):
        discrepancy(tmp_path / "campaign", tmp_path / "out", scheduler="tcp://127.0.0.1:1")


def test_without_dask_the_way_to_it_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "impactcell.cli.cluster", None)
    campaigns.write(make(shots=12), tmp_path / "campaign")
    with pytest.raises(DiscrepancyError, match=r"pip install -e '\.\[cluster\]'` in the checkout"):
        discrepancy(tmp_path / "campaign", tmp_path / "out", scheduler="tcp://127.0.0.1:1")
