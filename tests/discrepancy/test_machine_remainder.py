"""What the report of a machine says of what remains, where there is little to be said of it."""

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import (
    BaseModel,
    FallOfGap,
    MachineFinding,
    NumberPrior,
    investigate_machine,
)
from impactcell.discrepancy.report.machine_page import write_machine_reports
from impactcell.discrepancy.report.machine_result import machine_document
from impactcell.german.findings import REPORTS
from impactcell.records import Capture, Channel

pytestmark = pytest.mark.slow

BASE = "{format: 1, coordinate: translation, excitation: free, mass_kg: 1.0, terms: [coulomb_friction]}"


@lru_cache
def short_slides() -> Campaign:
    """Slides of a few rows each, whose friction scatters from one to the next."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 1.0, 0.01)
    shots = []
    for number in range(1, 31):
        braking = 0.15 * 9.81 * (1.0 + 0.15 * rng.standard_normal())
        moving = np.minimum(time, 0.3)
        position = 0.3 * braking * moving - 0.5 * braking * moving**2 + rng.normal(0.0, 1e-5, time.size)
        shots.append(Capture(number, math.nan, 1.0, None, Channel(time, position, 1e-5)))
    return Campaign(Excitation.FREE_SLIDE, tuple(shots))


@lru_cache
def found() -> MachineFinding:
    return investigate_machine(short_slides(), BaseModel(inertia=NumberPrior(1.0)))


def pages(finding: MachineFinding, directory: Path) -> list[str]:
    write_machine_reports(finding, machine_document(finding), "slides", directory)
    return [(directory / name).read_text(encoding="utf-8") for name in REPORTS.values()]


def test_a_report_is_written_where_no_record_shows_a_correlation_time(tmp_path: Path) -> None:
    """All of the work was lost by a traceback."""
    finding = replace(found(), remainder=replace(found().remainder, correlation_s=math.nan))
    assert machine_document(finding)["remaining"]["model_error"]["correlation_s"] is None
    for page, clause in zip(pages(finding, tmp_path), ("is like what is left", "gleicht dem"), strict=True):
        assert clause not in page
        assert "% of the held-out gap" in page or "% der Abweichung an Zurückgehaltenem" in page


@pytest.mark.parametrize(
    ("before", "after", "share"), [(3.0, 2.0, 0.5), (3.0, 0.9, 0.0), (1.04, 1.3, 0.0), (0.99, 1.7, 0.0)]
)
def test_what_remains_is_a_share_of_the_gap_only_where_there_is_one(
    before: float, after: float, share: float, tmp_path: Path
) -> None:
    """Of a gap of 1 less a hundred-millionth -7e7 of it were told to remain."""
    fall = FallOfGap(before, after, math.nan, math.nan, math.nan, 0.5)
    finding = replace(found(), fall=fall, train_gaps=(3.0, 3.0))
    assert machine_document(finding)["remaining"]["share"] == pytest.approx(share)
    english, german = pages(finding, tmp_path)
    assert ("What remains: 50 % of the held-out gap, " in english) is (share > 0.0)
    assert ("Was bleibt: 50 % der Abweichung an Zurückgehaltenem, " in german) is (share > 0.0)
    assert "What remains: " in english
    assert "Was bleibt: " in german
